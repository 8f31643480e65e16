#include "workloads/mapping/generate_bal.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>

#include "workloads/base/math/gaussian.h"
#include "workloads/base/math/random.h"
#include "workloads/mapping/reprojection.h"

namespace pirt::mapping {
namespace {

constexpr double kHalfWidthPx = 320;
constexpr double kHalfHeightPx = 240;
constexpr double kFocalPx = 500;
constexpr double kRingM = 5;
constexpr double kNearestM = 0.5;

using Vector = std::array<double, 3>;

/// The rotation (row-major, world to camera) that looks along -z from @p eye to @p at, y upwards.
std::array<double, 9> look_at(const Vector& eye, const Vector& at) {
  const auto normalized = [](Vector v) {
    const double norm = std::hypot(v[0], v[1], v[2]);
    return Vector{v[0] / norm, v[1] / norm, v[2] / norm};
  };
  const auto cross = [](const Vector& a, const Vector& b) {
    return Vector{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  const Vector back = normalized({eye[0] - at[0], eye[1] - at[1], eye[2] - at[2]});
  const Vector right = normalized(cross({0, 0, 1}, back));
  const Vector up = cross(back, right);
  return {right[0], right[1], right[2], up[0], up[1], up[2], back[0], back[1], back[2]};
}

void append_camera(int index, int images, std::vector<double>& cameras) {
  const double turn = 2 * std::numbers::pi * index / images;
  // Up and down by half a metre, so that not all lies in one plane.
  const Vector eye = {kRingM * std::cos(turn), kRingM * std::sin(turn),
                      1.5 + 0.5 * std::sin(3 * turn)};
  const auto rotation = look_at(eye, {0, 0, 1.5});
  std::array<double, kCameraSize> camera{};
  ceres::RotationMatrixToAngleAxis(ceres::RowMajorAdapter3x3(rotation.data()), camera.data());
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t k = 0; k < 3; ++k) camera[3 + row] -= rotation[3 * row + k] * eye[k];
  }
  camera[6] = kFocalPx;
  camera[7] = -0.05;
  camera[8] = 0.01;
  cameras.insert(cameras.end(), camera.begin(), camera.end());
}

/// The images, in their order, that have the point in view.
std::vector<std::int32_t> viewers(const std::vector<double>& cameras, const Vector& point) {
  std::vector<std::int32_t> found;
  for (std::size_t i = 0; i * kCameraSize < cameras.size(); ++i) {
    const double* camera = &cameras[i * kCameraSize];
    Vector p{};
    ceres::AngleAxisRotatePoint(camera, point.data(), p.data());
    if (p[2] + camera[5] > -kNearestM) continue;
    const auto pixel = project(camera, point.data());
    if (std::abs(pixel[0]) < kHalfWidthPx && std::abs(pixel[1]) < kHalfHeightPx) {
      found.push_back(static_cast<std::int32_t>(i));
    }
  }
  return found;
}

/// Part of those in view, one after another: features are lost again.
std::vector<std::int32_t> track(const std::vector<std::int32_t>& in_view, Random& random) {
  const auto length = std::min<std::size_t>(
      kShortestTrack + random.below(kLongestTrack - kShortestTrack + 1), in_view.size());
  const auto first = random.below(in_view.size() - length + 1);
  const auto begin = in_view.begin() + static_cast<std::ptrdiff_t>(first);
  return {begin, begin + static_cast<std::ptrdiff_t>(length)};
}

void append_points(const BalParameters& parameters, Random& random, BalProblem& truth) {
  while (truth.point_count() < static_cast<std::size_t>(parameters.points)) {
    const Vector point = {random.uniform(-2.5, 2.5), random.uniform(-2.5, 2.5),
                          random.uniform(0, 3)};
    const auto in_view = viewers(truth.cameras, point);
    if (in_view.size() < kShortestTrack) continue;
    const auto index = static_cast<std::int32_t>(truth.point_count());
    for (const auto camera : track(in_view, random)) {
      const auto pixel =
          project(&truth.cameras[static_cast<std::size_t>(camera) * kCameraSize], point.data());
      truth.observations.push_back({camera, index, pixel[0], pixel[1]});
    }
    truth.points.insert(truth.points.end(), point.begin(), point.end());
  }
}

void disturb_observations(const BalParameters& parameters, GeneratedBal& made) {
  Gaussian noise(derive_seed(parameters.seed, "noise"));
  Random random(derive_seed(parameters.seed, "outliers"));
  for (std::size_t i = 0; i < made.problem.observations.size(); ++i) {
    auto& seen = made.problem.observations[i];
    seen.x += parameters.noise_px * noise.next();
    seen.y += parameters.noise_px * noise.next();
    if (random.uniform() >= parameters.outliers) continue;
    seen.x = random.uniform(-kHalfWidthPx, kHalfWidthPx);
    seen.y = random.uniform(-kHalfHeightPx, kHalfHeightPx);
    made.outliers.push_back(i);
  }
}

void disturb_guess(const BalParameters& parameters, BalProblem& problem) {
  Gaussian noise(derive_seed(parameters.seed, "guess"));
  constexpr double kTurnRad = 0.5 * std::numbers::pi / 180;
  constexpr std::array<double, kCameraSize> kOff = {kTurnRad, kTurnRad,        kTurnRad, 0.03, 0.03,
                                                    0.03,     0.01 * kFocalPx, 0,        0};
  for (std::size_t i = 0; i < problem.cameras.size(); ++i) {
    problem.cameras[i] += kOff[i % kCameraSize] * noise.next();
  }
  for (double& coordinate : problem.points) coordinate += 0.1 * noise.next();
}

}  // namespace

GeneratedBal generate_bal(const BalParameters& parameters) {
  assert(parameters.images >= kLeastImages && parameters.points >= 1);
  GeneratedBal made;
  for (int i = 0; i < parameters.images; ++i) {
    append_camera(i, parameters.images, made.truth.cameras);
  }
  Random points(derive_seed(parameters.seed, "points"));
  append_points(parameters, points, made.truth);
  made.problem = made.truth;
  disturb_observations(parameters, made);
  disturb_guess(parameters, made.problem);
  return made;
}

}  // namespace pirt::mapping
