// Bundle adjustment: a published problem, generated ones whose answer is known, and bad files.
#include "workloads/mapping/bundle_adjust.h"

#include <ceres/rotation.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>

#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "workloads/base/geometry/geometry.h"
#include "workloads/mapping/generate_bal.h"

namespace pirt::mapping {
namespace {

using test::bad_input;
using testing::AllOf;
using testing::HasSubstr;

TEST(BundleAdjust, ReachesTheKnownCostOfLadybug49) {
  PIRT_DATA_OR_SKIP(folder, "bal-ladybug-49");
  auto problem = read_bal(folder / "problem-49-7776-pre.txt");
  EXPECT_EQ(problem.camera_count(), 49U);
  EXPECT_EQ(problem.point_count(), 7776U);
  ASSERT_EQ(problem.observations.size(), 31843U);
  const auto summary = bundle_adjust(problem, {});
  EXPECT_NEAR(summary.initial_cost, 850'912, 1);
  EXPECT_LE(summary.final_cost, 13'400);
}

/// The RMS of those residuals, a coordinate, that are of no generated outlier, corrected for the
/// parameters: from the truth, not from what the adjustment takes for outliers.
double inlier_noise_px(const BalProblem& adjusted, const GeneratedBal& made) {
  const auto residuals = residuals_px(adjusted);
  double sum = 0;
  double count = 0;
  auto outlier = made.outliers.begin();
  for (std::size_t i = 0; i < made.problem.observations.size(); ++i) {
    if (outlier != made.outliers.end() && *outlier == i) {
      ++outlier;
      continue;
    }
    sum += residuals[2 * i] * residuals[2 * i] + residuals[2 * i + 1] * residuals[2 * i + 1];
    count += 2;
  }
  const auto parameters = static_cast<double>(adjusted.cameras.size() + adjusted.points.size());
  return std::sqrt(sum / count) / std::sqrt(1 - parameters / count);
}

TEST(BundleAdjust, FindsTheNoiseOfAHundredImages) {
  const auto made = generate_bal({});
  auto problem = made.problem;
  const auto summary = bundle_adjust(problem, {});
  EXPECT_TRUE(summary.converged);
  EXPECT_NEAR(inlier_noise_px(problem, made), 1, 0.05);
  EXPECT_NEAR(summary.noise_px, 1, 0.05);
}

TEST(BundleAdjust, SurvivesOutliersWithARobustLoss) {
  BalParameters parameters;
  parameters.outliers = 0.02;
  const auto made = generate_bal(parameters);
  auto problem = made.problem;
  const auto summary = bundle_adjust(problem, {.loss = Loss::kCauchy});
  EXPECT_NEAR(inlier_noise_px(problem, made), 1, 0.05);
  EXPECT_NEAR(summary.noise_px, 1, 0.05);
  const auto all = static_cast<double>(made.problem.observations.size());
  // An outlier among four observations of a point takes one or two of the others with it.
  EXPECT_NEAR(static_cast<double>(summary.inliers) / all, 0.98, 0.01);

  // Without one it does not: the test can fail.
  problem = made.problem;
  static_cast<void>(bundle_adjust(problem, {.most_iterations = 8}));
  EXPECT_GT(inlier_noise_px(problem, made), 1.5);
}

TEST(BundleAdjust, LeavesWhatIsFixed) {
  const auto made = generate_bal({.images = 12, .points = 150});
  auto problem = made.problem;
  std::copy_n(made.truth.cameras.begin(), 2 * kCameraSize, problem.cameras.begin());
  const auto before = problem;
  const auto summary = bundle_adjust(problem, {.fixed_intrinsics = true, .fixed_cameras = {0, 1}});
  EXPECT_EQ(summary.free_parameters, 10 * 6 + 150 * 3);
  for (std::size_t i = 0; i < problem.cameras.size(); ++i) {
    const bool fixed = i < 2 * kCameraSize || i % kCameraSize >= 6;
    EXPECT_EQ(problem.cameras[i] == before.cameras[i], fixed) << i;
  }
}

TEST(BundleAdjust, RefusesWhatDoesNotFit) {
  const auto made = generate_bal({.images = 10, .points = 60});
  const auto refusal = [&](const auto& spoil) {
    auto problem = made.problem;
    spoil(problem);
    return bad_input([&] { static_cast<void>(bundle_adjust(problem, {})); });
  };
  EXPECT_THAT(refusal([](BalProblem& p) { p.observations[1].point = 60; }),
              HasSubstr("observation 2: point 60 does not exist"));
  EXPECT_THAT(refusal([](BalProblem& p) { p.observations[1].camera = 10; }),
              HasSubstr("observation 2: camera 10 does not exist; there are 10"));
  EXPECT_THAT(refusal([](BalProblem& p) { p.cameras.pop_back(); }), HasSubstr("89"));
  EXPECT_THAT(refusal([](BalProblem& p) { p.observations.clear(); }), HasSubstr("observations"));
}

TEST(BundleAdjust, PriorsTellHowLargeAllIsAndWhere) {
  const auto made = generate_bal({.images = 12, .points = 150, .noise_px = 0});
  // The centres of all cameras but those of the last three.
  BundleOptions options{.fixed_intrinsics = true};
  const auto centre = [](const BalProblem& problem, std::size_t i) {
    const double* const camera = &problem.cameras[i * kCameraSize];
    const std::array back = {-camera[0], -camera[1], -camera[2]};
    std::array<double, 3> turned{};
    ceres::AngleAxisRotatePoint(back.data(), camera + 3, turned.data());
    return std::array{-turned[0], -turned[1], -turned[2]};
  };
  for (std::int32_t i = 0; i < 9; ++i) {
    options.priors.push_back({i, centre(made.truth, static_cast<std::size_t>(i)), 10});
  }
  // All of it half as large, which no picture would notice.
  auto problem = made.truth;
  for (double& coordinate : problem.points) coordinate /= 2;
  for (std::size_t i = 0; i < problem.cameras.size(); ++i) {
    if (i % kCameraSize >= 3 && i % kCameraSize < 6) problem.cameras[i] /= 2;
  }
  static_cast<void>(bundle_adjust(problem, options));
  for (std::size_t i = 0; i < 12; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(centre(problem, i)[axis], centre(made.truth, i)[axis], 1e-3) << i;
    }
  }
  options.priors[3].camera = 12;
  EXPECT_THAT(bad_input([&] { static_cast<void>(bundle_adjust(problem, options)); }),
              HasSubstr("prior 4: camera 12"));
}

/// World to camera.
Pose pose(const BalProblem& problem, std::size_t i) {
  const double* const camera = &problem.cameras[i * kCameraSize];
  return {rotation_of(Eigen::Vector3d(camera)), Eigen::Vector3d(camera + 3)};
}

TEST(BundleAdjust, APriorTellsWhichWayAllIsTurned) {
  const auto made = generate_bal({.images = 12, .points = 150, .noise_px = 0});
  const Pose held = pose(made.truth, 2);
  PosePrior prior{.camera = 2, .px_per_unit = 1e4, .px_per_rad = 1e4};
  const Eigen::Vector3d centre = held.inverse().position;
  const Eigen::Vector3d turn = vector_of(held.rotation);
  std::copy_n(centre.data(), 3, prior.centre.begin());
  std::copy_n(turn.data(), 3, prior.turn.begin());
  BundleOptions options{.fixed_intrinsics = true, .priors = {prior}};
  // All of it turned about that camera, which no picture would notice.
  auto problem = made.truth;
  const Eigen::Matrix3d off = rotation_of({0.1, -0.2, 0.3});
  for (std::size_t i = 0; i < problem.points.size(); i += kPointSize) {
    Eigen::Map<Eigen::Vector3d> point(&problem.points[i]);
    point = centre + off * (point - centre);
  }
  for (std::size_t i = 0; i < problem.camera_count(); ++i) {
    const Pose camera = pose(problem, i);
    const Eigen::Matrix3d turned = camera.rotation * off.transpose();
    Eigen::Map<Eigen::Vector3d>(&problem.cameras[i * kCameraSize]) = vector_of(turned);
    Eigen::Map<Eigen::Vector3d>(&problem.cameras[i * kCameraSize + 3]) =
        -turned * (centre + off * (camera.inverse().position - centre));
  }
  static_cast<void>(bundle_adjust(problem, options));
  for (std::size_t i = 0; i < 12; ++i) {
    EXPECT_LT(angle_of(pose(problem, i).rotation.transpose() * pose(made.truth, i).rotation), 1e-4)
        << i;
  }
}

TEST(BundleAdjust, AWayThatIsKnownTellsHowLargeAllIs) {
  const auto made = generate_bal({.images = 12, .points = 150, .noise_px = 0});
  BundleOptions options{.fixed_intrinsics = true, .fixed_cameras = {2}};
  const Pose way = pose(made.truth, 7) * pose(made.truth, 2).inverse();
  const Eigen::Vector3d turn = vector_of(way.rotation);
  RelativePose known{.from = 2, .to = 7, .px_per_rad = 1e4, .px_per_unit = 1e4};
  std::copy_n(turn.data(), 3, known.turn.begin());
  std::copy_n(way.position.data(), 3, known.move.begin());
  options.relative.push_back(known);
  // All of it half as large about the camera that stays, and off by some noise.
  auto problem = made.truth;
  const Eigen::Vector3d centre = pose(problem, 2).inverse().position;
  for (std::size_t i = 0; i < problem.points.size(); i += kPointSize) {
    Eigen::Map<Eigen::Vector3d> point(&problem.points[i]);
    point = centre + 0.5 * (point - centre);
  }
  for (std::size_t i = 0; i < problem.camera_count(); ++i) {
    const Pose camera = pose(problem, i);
    const Eigen::Vector3d place = centre + 0.5 * (camera.inverse().position - centre);
    Eigen::Map<Eigen::Vector3d>(&problem.cameras[i * kCameraSize + 3]) = -(camera.rotation * place);
  }
  static_cast<void>(bundle_adjust(problem, options));
  for (std::size_t i = 0; i < 12; ++i) {
    EXPECT_LT((pose(problem, i).inverse().position - pose(made.truth, i).inverse().position).norm(),
              1e-3)
        << i;
  }
  options.relative[0].to = 12;
  EXPECT_THAT(bad_input([&] { static_cast<void>(bundle_adjust(problem, options)); }),
              HasSubstr("relative pose 1: camera 12"));
  options.relative[0].to = 2;
  EXPECT_THAT(bad_input([&] { static_cast<void>(bundle_adjust(problem, options)); }),
              HasSubstr("against itself"));
}

TEST(BundleAdjust, RefusesAPointInTheCamerasPlane) {
  auto problem = generate_bal({.images = 10, .points = 20}).problem;
  const auto& seen = problem.observations[5];
  double* camera = &problem.cameras[static_cast<std::size_t>(seen.camera) * kCameraSize];
  double* point = &problem.points[static_cast<std::size_t>(seen.point) * kPointSize];
  std::fill_n(camera, 6, 0.0);
  std::fill_n(point, 3, 0.0);
  EXPECT_THAT(bad_input([&] { static_cast<void>(bundle_adjust(problem, {})); }),
              HasSubstr("lies in the plane of camera"));
}

TEST(GenerateBal, SeesEachPointOftenEnoughAndRepeats) {
  const auto made = generate_bal({.images = 30, .points = 300, .outliers = 0.1, .seed = 4});
  std::vector<int> seen(300);
  for (const auto& observation : made.problem.observations) {
    ++seen[static_cast<std::size_t>(observation.point)];
  }
  EXPECT_GE(std::ranges::min(seen), kShortestTrack);
  const auto all = static_cast<double>(made.problem.observations.size());
  EXPECT_NEAR(static_cast<double>(made.outliers.size()) / all, 0.1, 0.03);
  for (const double residual : residuals_px(made.truth)) EXPECT_NEAR(residual, 0, 1e-9);
  const auto again = generate_bal({.images = 30, .points = 300, .outliers = 0.1, .seed = 4});
  EXPECT_EQ(bal_text(again.problem), bal_text(made.problem));
}

class BalFiles : public testing::Test {
 protected:
  static std::filesystem::path write(const std::string& text) {
    const auto file = testing::TempDir() + "/pirt-" + std::to_string(::getpid()) + ".bal";
    std::ofstream(file) << text;
    return file;
  }
  static std::string refused(const std::string& text) {
    return bad_input([&] { static_cast<void>(read_bal(write(text))); });
  }
};

const std::string kCamera = "0\n0\n0\n0\n0\n-5\n500\n0\n0\n";

TEST_F(BalFiles, RoundTripToTheSameBits) {
  const auto made = generate_bal({.images = 8, .points = 40});
  const auto read = read_bal(write(bal_text(made.problem)));
  EXPECT_EQ(read.cameras, made.problem.cameras);
  EXPECT_EQ(read.points, made.problem.points);
  EXPECT_EQ(bal_text(read), bal_text(made.problem));
}

TEST_F(BalFiles, ThatAreDamagedAreRefusedWithTheirLine) {
  EXPECT_EQ(read_bal(write("1 1 1\n0 0 1 2\n" + kCamera + "0\n0\n0\n")).observations.size(), 1U);
  EXPECT_THAT(refused(""), HasSubstr("number of cameras"));
  EXPECT_THAT(refused("0 1 1\n"), HasSubstr("number of cameras must be between 1"));
  EXPECT_THAT(refused("1 1 1\n1 0 1 2\n" + kCamera + "0\n0\n0\n"),
              AllOf(HasSubstr(":2: the camera of an observation"), HasSubstr("got 1")));
  EXPECT_THAT(refused("1 1 1\n0 -1 1 2\n" + kCamera + "0\n0\n0\n"),
              HasSubstr("point of an observation"));
  EXPECT_THAT(refused("1 1 1\n0 0 nan 2\n" + kCamera + "0\n0\n0\n"),
              AllOf(HasSubstr(":2: the x of an observation"), HasSubstr("'nan'")));
  EXPECT_THAT(refused("1 1 1\n0 0 1 2\n" + kCamera + "0\n0\ninf\n"),
              HasSubstr(":14: the coordinate of a point"));
  EXPECT_THAT(refused("1 1 1\n0 0 1 2\n" + kCamera + "0\n0\n"), HasSubstr("ends"));
  EXPECT_THAT(refused("1 1 1\n0 0 1 2\n" + kCamera + "0\n0\n0\n7\n"), HasSubstr("more than"));
  EXPECT_THAT(refused("40000000 40000000 40000000\n0 0 1 2\n"), HasSubstr("the file ends before"));
}

}  // namespace
}  // namespace pirt::mapping
