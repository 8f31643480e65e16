// The whole pipeline against truth, on generated sequences and on real pictures. Every goal stands
// beside what the trivial answer scores. Time is never asserted.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <memory>

#include "tests/support/data.h"
#include "tests/support/long.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/slam/run/pipeline.h"
#include "workloads/slam/run/plot.h"
#include "workloads/slam/run/summary.h"

namespace pirt::slam {
namespace {

namespace fs = std::filesystem;
using test::mono;
using test::remembering;

RunResult run(const Sequence& sequence) {
  RunOptions options;
  options.setup = setup_of(sequence);
  return run_serially(sequence, options);
}

double percent(const TrajectoryError& error) { return 100 * error.ate_rms_m / error.path_m; }

struct Honesty {
  double inside = 0;        ///< Part of frames within the 99 % ellipsoid.
  double nees = 0;          ///< Mean of the squared distance in sigmas; 3 where all is as said.
  double median_sigma = 0;  ///< Root of the covariance's trace.
  double rms = 0;
};

/// Of positions relative to the start, which is what the filter's covariance is about.
Honesty honesty_of(const RunResult& result, const Sequence& sequence) {
  constexpr double kChiSquare99 = 11.345;  // 3 degrees of freedom
  const auto to_truth = align(result.trajectory(), sequence.truth, Alignment::kStartYaw);
  std::vector<double> sigmas;
  double inside = 0;
  double distances = 0;
  double squares = 0;
  for (const auto& frame : result.frames) {
    const auto truth = truth_at(sequence.truth, frame.pose.time);
    if (!truth || frame.status == Status::kStarting) continue;
    const Eigen::Vector3d miss = to_truth * frame.pose.body.position - truth->position;
    const Eigen::Matrix3d& r = to_truth.pose.rotation;
    const Eigen::Matrix3d covariance =
        r * frame.position_covariance * r.transpose() + 1e-8 * Eigen::Matrix3d::Identity();
    const double distance = miss.dot(covariance.ldlt().solve(miss));
    distances += distance;
    inside += distance < kChiSquare99 ? 1 : 0;
    sigmas.push_back(std::sqrt(covariance.trace()));
    squares += miss.squaredNorm();
  }
  const auto count = static_cast<double>(sigmas.size());
  std::ranges::sort(sigmas);
  return {inside / count, distances / count, sigmas[sigmas.size() / 2], std::sqrt(squares / count)};
}

// Ten seconds of what the long test does for five seeds of a minute.
TEST(SlamQuality, StereoWithImuStaysWithinHalfAPercentAndIsHonest) {
  const auto sequence = remembering(generate_sequence(test::scene(1, 10.0)));
  const auto result = run(sequence);
  const auto error = evaluate(result.trajectory(), sequence.truth, Alignment::kSe3);
  EXPECT_LE(percent(error), 0.5) << error.ate_rms_m << " m";
  const auto honesty = honesty_of(result, sequence);
  EXPECT_GE(honesty.inside, 0.9);
  EXPECT_LE(honesty.median_sigma, 3 * honesty.rms);
  for (const auto& frame : result.frames) EXPECT_NE(frame.status, Status::kLost);

  // Without the update stage the drift grows: it is the updates that hold it.
  RunOptions blind;
  blind.setup = setup_of(sequence);
  blind.setup.update = false;
  const auto drifting = run_serially(sequence, blind).trajectory();
  const auto half = std::span(drifting).first(drifting.size() / 2);
  const double early = evaluate(half, sequence.truth, Alignment::kStartYaw).ate_max_m;
  const double late = evaluate(drifting, sequence.truth, Alignment::kStartYaw).ate_max_m;
  const double corrected =
      evaluate(result.trajectory(), sequence.truth, Alignment::kStartYaw).ate_max_m;
  EXPECT_GT(late, 2 * early);
  EXPECT_GT(late, 10 * corrected);
}

TEST(SlamQuality, MonoWithImuStaysWithinOneAndAHalfPercent) {
  const auto sequence = generate_sequence(test::scene(2, 10.0, false));
  const auto error = evaluate(run(sequence).trajectory(), sequence.truth, Alignment::kSe3);
  EXPECT_LE(percent(error), 1.5) << error.ate_rms_m << " m";
}

/// Positions along a flight are off together, so that many flights tell what one cannot.
void expect_honest(const std::vector<Honesty>& flights) {
  double mean = 0;
  for (const auto& each : flights) mean += each.nees / static_cast<double>(flights.size());
  std::printf("mean NEES %.2f of %zu flights\n", mean, flights.size());
  const double wider = test::long_tests() ? 1 : 2;
  EXPECT_GE(mean, 1.5 / wider);
  EXPECT_LE(mean, 6 * wider);
}

// Run by `ctest -C long -L long`: five seeds of a minute; otherwise one of four seconds, so that it
// is known to work.
TEST(SlamLong, FiveSeedsOfAMinute) {
  std::vector<Honesty> two_cameras, one_camera;
  for (int seed = 1; seed <= test::repeats(1, 5); ++seed) {
    const auto stereo = remembering(generate_sequence(
        test::scene(static_cast<std::uint64_t>(seed), test::long_tests() ? 60.0 : 4.0)));
    const auto fly = [&](const Sequence& sequence, double most_percent) {
      const auto result = run(sequence);
      const auto error = evaluate(result.trajectory(), sequence.truth, Alignment::kSe3);
      const auto honesty = honesty_of(result, sequence);
      std::printf(
          "seed %d: path %.1f m, %.3f %%; inside 99 %%: %.1f %%, NEES %.2f, median sigma %.4f m, "
          "RMS %.4f m\n",
          seed, error.path_m, percent(error), 100 * honesty.inside, honesty.nees,
          honesty.median_sigma, honesty.rms);
      EXPECT_LE(percent(error), most_percent) << seed;
      const double shyest = test::long_tests() ? 3 : 10;  // 4 s are too short for a statistic
      EXPECT_LE(honesty.median_sigma, shyest * honesty.rms) << seed;
      return honesty;
    };
    two_cameras.push_back(fly(stereo, 0.5));
    one_camera.push_back(fly(mono(stereo), 1.5));
  }
  if (!test::long_tests()) return;  // too short for a statistic
  double inside = 0;
  for (const auto& each : two_cameras) inside += each.inside;
  EXPECT_GE(inside, 0.9 * static_cast<double>(two_cameras.size()));
  expect_honest(two_cameras);
  expect_honest(one_camera);
}

// Neither bolder than it may be nor shyer than it could: 3 is expected of positions. Pictures of
// half the size, so that what is assumed of pixels is not what one size came to. By `ctest -C long
// -L long` 20 flights, otherwise two, whose mean tells less.
TEST(SlamConsistency, PositionsAreOffByWhatTheCovarianceSaysAndNotByLess) {
  const int flights = test::repeats(2, 20);
  std::vector<Honesty> two_cameras, one_camera;
  for (int i = 0; i < flights; ++i) {
    SceneOptions options = test::scene(101 + static_cast<std::uint64_t>(i), 12.0);
    options.width = 320;
    options.height = 240;
    const auto sequence = remembering(generate_sequence(options));
    two_cameras.push_back(honesty_of(run(sequence), sequence));
    one_camera.push_back(honesty_of(run(mono(sequence)), sequence));
    std::printf("flight %d: NEES %.2f with two cameras, %.2f with one\n", i,
                two_cameras.back().nees, one_camera.back().nees);
  }
  expect_honest(two_cameras);
  expect_honest(one_camera);
}

TEST(SlamQuality, OneCameraAloneFollowsTwoTurns) {
  SceneOptions options = test::scene(3, 22.0, false);
  options.path.shape = PathShape::kTurns;
  options.path.rest_s = 0.5;
  Sequence sequence = generate_sequence(options);
  sequence.imu.clear();
  sequence.imu_model.reset();
  const auto result = run(sequence);
  const auto error = evaluate(result.trajectory(), sequence.truth, Alignment::kSim3);
  EXPECT_LE(percent(error), 2.0) << error.ate_rms_m << " m";
  EXPECT_GT(error.path_m, 10);
  EXPECT_GT(result.trajectory().size(), 22U * 25 * 8 / 10);
}

TEST(SlamQuality, TwoCamerasAloneKnowTheScaleUnlessTheyAreTakenForEachOther) {
  SceneOptions options = test::scene(1, 2.0);
  options.path.shape = PathShape::kRing;
  Sequence sequence = remembering(generate_sequence(options));
  sequence.imu.clear();
  sequence.imu_model.reset();
  const auto result = run(sequence);
  EXPECT_NEAR(evaluate(result.trajectory(), sequence.truth, Alignment::kSim3).scale, 1, 0.1);
  EXPECT_TRUE(summarize(sequence, result, setup_of(sequence)).scale_known);
  sequence.image = [image = sequence.image](std::size_t frame, std::size_t camera) {
    return image(frame, 1 - camera);
  };
  EXPECT_FALSE(summarize(sequence, run(sequence), setup_of(sequence)).scale_known);
}

// No rotation at all scores 0.082 and 0.495. The truth of the first 12 frames is a straight line
// between its ends, so that what the car did in between counts as error.
TEST(SlamQuality, OneCameraAloneKnowsTheTurnsOfARealDrive) {
  PIRT_DATA_OR_SKIP(data, "kitti-odometry-urban");
  const auto sequence = read_sequence(data);
  const auto result = run(sequence);
  const auto summary = summarize(sequence, result, setup_of(sequence));
  ASSERT_TRUE(summary.error.has_value());
  ASSERT_EQ(summary.turns.size(), 2U);
  const auto& [one, ten] = std::tie(summary.turns[0], summary.turns[1]);
  std::printf(
      "rotation %.4f and %.4f degrees (no turn: %.4f and %.4f); RMS %.3f m of %.1f m "
      "(constant velocity: %.3f m)\n",
      one.mean_deg, ten.mean_deg, one.trivial_deg, ten.trivial_deg, summary.error->ate_rms_m,
      summary.error->path_m, summary.constant_velocity_ate_rms_m.value_or(-1));
  // 0.0320 and 0.092 when this was written; processors round differently.
  EXPECT_LE(one.mean_deg, 0.033);
  EXPECT_LE(ten.mean_deg, 0.11);
}

/// The static clip in EuRoC's layout: it is kept flat in the data.
void lay_out(const fs::path& data, const fs::path& root) {
  for (const char* camera : {"cam0", "cam1"}) {
    fs::create_directories(root / camera / "data");
    fs::copy(data / camera / "sensor.yaml", root / camera / "sensor.yaml");
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(data / camera)) {
      if (entry.path().extension() != ".png") continue;
      names.push_back(entry.path().filename().string());
      fs::create_symlink(entry.path(), root / camera / "data" / entry.path().filename());
    }
    std::ranges::sort(names);
    std::string csv;
    for (const auto& name : names) csv += fs::path(name).stem().string() + "," + name + "\n";
    test::put(root / camera / "data.csv", csv);
  }
  fs::create_directories(root / "imu0");
  fs::copy(data / "imu_first6s.csv", root / "imu0" / "data.csv");
  fs::copy(data / "imu_sensor.yaml", root / "imu0" / "sensor.yaml");
}

TEST(SlamQuality, ARobotAtRestDoesNotDrift) {
  PIRT_DATA_OR_SKIP(data, "euroc-v1_01-static-camera");
  const test::ScratchFolder scratch;
  lay_out(data, scratch.path() / "mav0");
  const auto sequence = read_sequence(scratch.path());
  EXPECT_THAT(sequence.warnings, testing::Not(testing::IsEmpty())) << "cam1 has 4 of 20 pictures";
  for (const auto& variant : {sequence, mono(sequence)}) {
    double most = 0;
    const auto poses = run(variant).trajectory();
    ASSERT_GT(poses.size(), 10U);
    for (const auto& pose : poses) {
      most = std::max(most, (pose.body.position - poses.front().body.position).norm());
    }
    EXPECT_LT(most, 0.02);
  }
}

TEST(SlamQuality, ASecondOfBlackIsSaidAndSurvived) {
  const auto sequence = remembering(generate_sequence(test::scene(4, 8.0)));
  constexpr std::size_t kBlack = 100;
  constexpr std::size_t kSecond = 25;
  RunOptions options;
  options.setup = setup_of(sequence);
  options.spoil = [&](std::size_t frame, std::size_t, GreyImage& image) {
    if (frame >= kBlack && frame < kBlack + kSecond) std::ranges::fill(image.pixels, 0);
  };
  const auto result = run_serially(sequence, options);
  EXPECT_EQ(result.frames[kBlack - 1].status, Status::kTracking);
  EXPECT_TRUE(result.frames[kBlack + 2].unusable);
  for (std::size_t i = kBlack + 5; i < kBlack + kSecond; ++i) {
    EXPECT_EQ(result.frames[i].status, Status::kLost) << i;
  }
  for (std::size_t i = kBlack + 3 * kSecond; i < result.frames.size(); ++i) {
    EXPECT_EQ(result.frames[i].status, Status::kTracking) << i;
  }
  const auto to_truth = align(result.trajectory(), sequence.truth, Alignment::kStartYaw);
  for (const auto& frame : result.frames) {
    if (frame.status == Status::kStarting) continue;
    const auto truth = truth_at(sequence.truth, frame.pose.time);
    ASSERT_TRUE(truth.has_value());
    // What is said to be good is good.
    if (frame.status == Status::kTracking) {
      EXPECT_LT((to_truth * frame.pose.body.position - truth->position).norm(), 0.15);
    }
  }
  const auto sigma = [&](std::size_t i) {
    return std::sqrt(result.frames[i].position_covariance.trace());
  };
  EXPECT_GT(sigma(kBlack + kSecond - 1), 2 * sigma(kBlack - 1));
}

TEST(SlamQuality, OneCameraAloneFindsItsPlaceAgainAfterASecondOfBlack) {
  SceneOptions options = test::scene(5, 9.0, false);
  options.path.rest_s = 0;
  Sequence sequence = remembering(generate_sequence(options));
  sequence.imu.clear();
  sequence.imu_model.reset();
  constexpr std::size_t kBlack = 125;
  sequence.frames.resize(kBlack + 75);
  RunOptions run_options;
  run_options.setup = setup_of(sequence);
  run_options.spoil = [&](std::size_t frame, std::size_t, GreyImage& image) {
    // Still pictures of before: the robot looks where it looked.
    if (frame >= kBlack && frame < kBlack + 25) std::ranges::fill(image.pixels, 128);
    if (frame >= kBlack + 25) image = sequence.image(2 * kBlack + 24 - frame, 0);
  };
  const auto result = run_serially(sequence, run_options);
  EXPECT_EQ(result.frames[kBlack + 10].status, Status::kLost);
  const auto found =
      std::find_if(result.frames.begin() + kBlack + 25, result.frames.begin() + kBlack + 75,
                   [](const FrameResult& frame) { return frame.status == Status::kTracking; });
  ASSERT_NE(found, result.frames.begin() + kBlack + 75);
  // The same view, the same pose: to 5 % of the median depth, which is the unit of 5.
  const auto index = static_cast<std::size_t>(found - result.frames.begin());
  const auto& again = found->pose.body.position;
  const auto& then = result.frames[2 * kBlack + 24 - index].pose.body.position;
  EXPECT_LT((again - then).norm(), 0.25);
}

TEST(SlamQuality, SameInputsGiveTheSameBits) {
  const auto sequence = remembering(generate_sequence(test::scene(6, 3.5)));
  const auto a = run(sequence);
  const auto b = run(sequence);
  ASSERT_EQ(a.frames.size(), b.frames.size());
  for (std::size_t i = 0; i < a.frames.size(); ++i) {
    EXPECT_EQ(a.frames[i].pose.body.position, b.frames[i].pose.body.position);
    EXPECT_EQ(a.frames[i].position_covariance, b.frames[i].position_covariance);
  }
  EXPECT_EQ(a.last.covariance, b.last.covariance);
  EXPECT_LE(a.last.map.size(), static_cast<std::size_t>(slam::Setup{}.most_map_points));
  EXPECT_LE(a.last.landmarks.size(), static_cast<std::size_t>(slam::Setup{}.most_landmarks));
}

}  // namespace
}  // namespace pirt::slam
