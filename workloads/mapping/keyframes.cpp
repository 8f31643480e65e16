#include "workloads/mapping/keyframes.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/slam/filter/measure.h"

namespace pirt::mapping {
namespace {

constexpr std::size_t kLeastViews = 3;
constexpr std::ptrdiff_t kLeastPoints = 12;
constexpr double kMostRelativeSigma = 0.3;  // of a point's depth
constexpr double kLeastSigma_m = 1e-3;      // the first keyframe's is 0: the world begins there

/// From the camera's axes (x right, y down, z ahead) to those of bal.h (y up, -z ahead), and back.
const Eigen::DiagonalMatrix<double, 3> kFlip(1, -1, -1);

void append_camera(const Pose& camera, double focal, std::vector<double>& cameras) {
  const Pose from_world = camera.inverse();
  const Eigen::Vector3d turn = vector_of(kFlip * from_world.rotation);
  const Eigen::Vector3d moved = kFlip * from_world.position;
  cameras.insert(cameras.end(), turn.data(), turn.data() + 3);
  cameras.insert(cameras.end(), moved.data(), moved.data() + 3);
  cameras.insert(cameras.end(), {focal, 0, 0});
}

/// Camera to world.
Pose pose_of(std::span<const double> camera) {
  const Eigen::Matrix3d rotation = kFlip * rotation_of(Eigen::Vector3d(camera.data()));
  const Eigen::Vector3d moved = kFlip * Eigen::Vector3d(camera.data() + 3);
  return Pose{rotation, moved}.inverse();
}

}  // namespace

Keyframes::Keyframes(slam::Setup setup, KeyframeOptions options)
    : setup_(std::move(setup)), options_(options) {}

bool Keyframes::add(const slam::State& state) {
  for (const slam::Track& track : state.tracks) {
    if (track.landmark >= 0) landmarks_[track.id] = track.landmark;
  }
  if (state.status != slam::Status::kTracking) return false;
  const Pose body = state.body();
  if (!keyframes_.empty()) {
    const Pose moved = keyframes_.back().pose.body.inverse() * body;
    if (moved.position.norm() < options_.least_move_m &&
        angle_of(moved.rotation) < options_.least_turn_rad) {
      return false;
    }
  }
  if (keyframes_.size() >= options_.most) thin_out();
  Keyframe& made = keyframes_.emplace_back();
  made.pose = {state.time, body};
  // Where nothing is uncertain, rounding may leave less than 0.
  made.sigma_m = std::sqrt(std::max(0.0, slam::position_covariance(state).trace() / 3));
  for (const slam::Track& track : state.tracks) {
    made.seen.push_back({track.id, setup_.cameras[0].ray(track.pixel.cast<double>())});
  }
  return true;
}

void Keyframes::thin_out() {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < keyframes_.size(); i += 2) {
    if (kept != i) keyframes_[kept] = std::move(keyframes_[i]);
    ++kept;
  }
  keyframes_.resize(kept);
  options_.least_move_m *= 2;
  options_.least_turn_rad *= 2;
}

Pose Keyframes::camera(std::size_t keyframe) const {
  return slam::camera_pose(setup_, keyframes_[keyframe].pose.body, 0);
}

BalProblem Keyframes::problem() const {
  struct Seen {
    std::size_t keyframe;
    Eigen::Vector2d ray;
  };
  std::map<std::int64_t, std::vector<Seen>> points;
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    for (const Sighting& sighting : keyframes_[i].seen) {
      const auto landmark = landmarks_.find(sighting.point);
      points[landmark == landmarks_.end() ? sighting.point : landmark->second].push_back(
          {i, sighting.ray});
    }
  }
  const double focal = setup_.cameras[0].focal();
  std::map<std::int64_t, Eigen::Vector3d> placed;
  std::vector<std::ptrdiff_t> seen_by(keyframes_.size());
  for (const auto& [id, seen] : points) {
    if (seen.size() < kLeastViews) continue;
    std::vector<slam::View> views;
    for (const Seen& each : seen) views.push_back({camera(each.keyframe), each.ray});
    const double sigma = setup_.pixel_sigma / focal;
    const auto point = slam::triangulate(views, sigma);
    if (!point || point->rms > 3 * sigma || point->relative_sigma > kMostRelativeSigma) continue;
    placed.emplace(id, point->point);
    for (const Seen& each : seen) ++seen_by[each.keyframe];
  }
  BalProblem problem;
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    append_camera(camera(i), focal, problem.cameras);
  }
  for (const auto& [id, place] : placed) {
    const auto index = static_cast<std::int32_t>(problem.point_count());
    problem.points.insert(problem.points.end(), place.data(), place.data() + 3);
    for (const Seen& each : points[id]) {
      if (seen_by[each.keyframe] < kLeastPoints) continue;
      problem.observations.push_back({static_cast<std::int32_t>(each.keyframe), index,
                                      focal * each.ray.x(), -focal * each.ray.y()});
    }
  }
  return problem;
}

std::vector<CentrePrior> Keyframes::priors() const {
  std::vector<CentrePrior> priors;
  // A drift is one error of all of them: together they weigh as one.
  const double alone = std::sqrt(static_cast<double>(keyframes_.size()));
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    CentrePrior& prior = priors.emplace_back();
    prior.camera = static_cast<std::int32_t>(i);
    const Eigen::Vector3d place = camera(i).position;
    std::ranges::copy(place, prior.centre.begin());
    prior.px_per_unit =
        setup_.pixel_sigma / (alone * std::max(keyframes_[i].sigma_m, kLeastSigma_m));
  }
  return priors;
}

RefinedMap Keyframes::refined(const BalProblem& adjusted) const {
  if (adjusted.camera_count() != keyframes_.size()) {
    throw_bad_input(fmt::format("{} cameras cannot be the poses of {} keyframes",
                                adjusted.camera_count(), keyframes_.size()));
  }
  std::vector<bool> moved(keyframes_.size());
  for (const Observation& seen : adjusted.observations) {
    moved[static_cast<std::size_t>(seen.camera)] = true;
  }
  // Of cameras, since a map that shrinks leaves the way from the camera to the body as it is.
  std::vector<StampedPose> estimate;
  std::vector<TruthRow> before;
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    if (!moved[i]) continue;
    const Nanos time = keyframes_[i].pose.time;
    const auto numbers = std::span(adjusted.cameras).subspan(i * kCameraSize, kCameraSize);
    estimate.push_back({time, pose_of(numbers)});
    TruthRow& row = before.emplace_back();
    row.time = time;
    row.body = camera(i);
  }
  if (estimate.size() < 3) {
    throw_bad_input(fmt::format("{} keyframes that see enough cannot be adjusted; it takes 3",
                                estimate.size()));
  }
  const Similarity back = align(estimate, before, Alignment::kSim3);
  const Pose camera_from_body = setup_.cameras[0].body_from_camera.inverse();
  RefinedMap map;
  for (std::size_t i = 0, next = 0; i < keyframes_.size(); ++i) {
    map.keyframes.push_back(keyframes_[i].pose);
    if (!moved[i]) continue;
    const Pose& camera = estimate[next++].body;
    map.keyframes.back().body =
        Pose{back.pose.rotation * camera.rotation, back * camera.position} * camera_from_body;
  }
  for (std::size_t i = 0; i < adjusted.points.size(); i += kPointSize) {
    map.points.push_back(back * Eigen::Vector3d(&adjusted.points[i]));
  }
  return map;
}

RefinedMap refine(const Keyframes& keyframes) {
  BalProblem problem = keyframes.problem();
  if (problem.observations.empty()) {
    throw_bad_input(
        fmt::format("{} keyframes share no points that could be adjusted", keyframes.all().size()));
  }
  BundleOptions options = robot_options();
  options.priors = keyframes.priors();
  const BundleSummary summary = bundle_adjust(problem, options);
  RefinedMap map = keyframes.refined(problem);
  map.summary = summary;
  return map;
}

}  // namespace pirt::mapping
