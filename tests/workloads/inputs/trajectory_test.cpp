// Errors of trajectories against values worked by hand, and trajectories as text.
#include "workloads/inputs/sequence/trajectory.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <utility>

#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/sequence/sequence.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;
using test::bad_input;
using test::put;
using testing::HasSubstr;

/// A square of 2 m, a pose a second.
std::vector<TruthRow> square() {
  std::vector<TruthRow> truth;
  const std::array<Eigen::Vector3d, 4> corners = {
      Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(2, 0, 0), Eigen::Vector3d(2, 2, 0),
      Eigen::Vector3d(0, 2, 1)};
  for (std::size_t i = 0; i < corners.size(); ++i) {
    TruthRow row;
    row.time = from_s(static_cast<double>(i) / 10);
    row.body = {rotation_of({0, 0, 0.1 * static_cast<double>(i)}), corners[i]};
    truth.push_back(row);
  }
  return truth;
}

TEST(Trajectory, AlignmentTakesOutWhatItMay) {
  const auto truth = square();
  const Pose moved{rotation_of({0.1, -0.4, 1.0}), {5, -3, 2}};
  std::vector<StampedPose> same;
  std::vector<StampedPose> half;
  for (const auto& row : truth) {
    const Pose body = moved * row.body;
    same.push_back({row.time, body});
    half.push_back({row.time, {body.rotation, 0.5 * body.position}});
  }
  EXPECT_NEAR(evaluate(same, truth, Alignment::kSe3).ate_rms_m, 0, 1e-9);
  EXPECT_NEAR(evaluate(same, truth, Alignment::kSe3).rotation_error_mean_deg.value(), 0, 1e-5);
  EXPECT_NEAR(evaluate(half, truth, Alignment::kSim3).ate_rms_m, 0, 1e-9);
  EXPECT_NEAR(evaluate(half, truth, Alignment::kSim3).scale, 2.0, 1e-9);
  EXPECT_GT(evaluate(half, truth, Alignment::kSe3).ate_rms_m, 0.3);
  EXPECT_NEAR(relative_rotation_error_deg(same, truth, 1).value(), 0, 1e-5);
  EXPECT_EQ(relative_rotation_error_deg(same, truth, same.size()), std::nullopt);
  EXPECT_THROW(static_cast<void>(align(std::span(same).first(2), truth, Alignment::kSe3)), Error);
}

// Along a line nothing tells how the whole is turned about it, and in a point nothing at all.
TEST(Trajectory, AttitudeIsKnownOnlyWherePositionsTellIt) {
  for (const auto alignment : {Alignment::kSe3, Alignment::kSim3}) {
    for (const double step : {0.0, 1.0}) {
      for (const double aside : {0.0, 1.0}) {
        for (const double noise : {0.0, 0.001}) {
          SCOPED_TRACE(fmt::format("{} {} {} {}", static_cast<int>(alignment), step, aside, noise));
          std::vector<TruthRow> truth(20);
          std::vector<StampedPose> poses;
          for (int i = 0; i < 20; ++i) {
            TruthRow& row = truth[static_cast<std::size_t>(i)];
            row.time = from_s(0.1 * i);
            row.body.position = {step * i, i % 3 == 0 ? step * aside : 0.0, 0};
            poses.push_back({row.time, row.body});
            poses.back().body.position.z() += i % 2 == 0 ? noise : 0.0;
          }
          const auto error = evaluate(poses, truth, alignment);
          EXPECT_LE(error.ate_rms_m, 0.001);
          const bool told = step > 0 && aside > 0;
          ASSERT_EQ(error.rotation_error_mean_deg.has_value(), told);
          EXPECT_LT(error.rotation_error_mean_deg.value_or(0), 0.1);
        }
      }
    }
  }
}

// All poses 0.3 m too high but one, 0.1 m too low: after aligning the start, errors are 0, 0, 0 and
// 0.4 m, so that the RMS is sqrt(0.16 / 4) = 0.2 m.
TEST(Trajectory, RmsIsThatOfTheAlignedPositions) {
  const auto truth = square();
  std::vector<StampedPose> poses;
  for (const auto& row : truth) {
    poses.push_back({row.time, row.body});
    poses.back().body.position.z() += 0.3;
  }
  poses.back().body.position.z() -= 0.4;
  const auto error = evaluate(poses, truth, Alignment::kStartYaw);
  EXPECT_NEAR(error.ate_rms_m, 0.2, 1e-12);
  EXPECT_NEAR(error.ate_max_m, 0.4, 1e-12);
  EXPECT_NEAR(error.path_m, 2 + 2 + std::sqrt(5.0), 1e-12);
}

TEST(Trajectory, TumTextHasNanosecondsAndTheQuaternionLast) {
  const std::vector<StampedPose> poses = {
      {Nanos(1'403'715'273'262'142'976), {rotation_of({0, 0, M_PI / 2}), {1, 2, 3}}}};
  EXPECT_EQ(test::line_of(tum_text(poses), 1),
            "1403715273.262142976 1.000000000 2.000000000 3.000000000 0.000000000 0.000000000 "
            "0.707106781 0.707106781");
}

TEST(Trajectory, TumTextHasTheSignOfTimesBeforeZeroInFront) {
  const std::vector<StampedPose> poses = {{Nanos(-1'500'000'000), {}}, {Nanos(-50'000'000), {}}};
  EXPECT_THAT(tum_text(poses),
              testing::AllOf(HasSubstr("\n-1.500000000 0.0"), HasSubstr("\n-0.050000000 0.0")));
}

TEST(Trajectory, AHeadingSaysWhereTheQuaternionHasItsRealPart) {
  const test::ScratchFolder scratch;
  const fs::path file = scratch.path() / "truth.txt";
  std::vector<std::string> warnings;
  const auto read = [&](const std::string& heading) {
    put(file, heading + "\n1 0 0 0 0.6 0 0 0.8\n2 0 0 0 0.6 0 0 0.8\n3 0 0 0 0.6 0 0 0.8\n");
    return Eigen::Quaterniond(read_tum(file, warnings).front().body.rotation);
  };
  EXPECT_NEAR(read("# timestamp tx ty tz qx qy qz qw").x(), 0.6, 1e-12);
  EXPECT_NEAR(read("# estimated trajectory").x(), 0.6, 1e-12);
  EXPECT_NEAR(read("# timestamp tx ty tz qw qx qy qz").w(), 0.6, 1e-12);
  EXPECT_NEAR(read("# timestamp [s] tx [m] ty [m] tz [m] qw [] qx [] qy [] qz []").w(), 0.6, 1e-12);
  EXPECT_THAT(bad_input([&] { read("# timestamp (in s) tx [mm] ty [mm] tz [mm] qx qy qz qw"); }),
              HasSubstr("column 2 is in mm"));
}

TEST(Trajectory, TruthIsNotMadeUpAcrossGaps) {
  auto truth = square();
  EXPECT_TRUE(truth_at(truth, from_s(0.15)).has_value());
  EXPECT_FALSE(truth_at(truth, from_s(0.35)).has_value());
  truth[3].time = from_s(2.0);
  EXPECT_FALSE(truth_at(truth, from_s(1.0)).has_value());
}

}  // namespace
}  // namespace pirt
