// Pictures and IMU that do not belong together are told, and those that do are not.
#include "workloads/slam/run/camera_imu.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/errors.h"
#include "tests/support/long.h"
#include "tests/workloads/inputs/sequence_support.h"

namespace pirt::slam {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

Sequence flight(std::uint64_t seed) {
  SceneOptions options = test::scene(seed, 8, false);
  options.width = 320;
  options.height = 240;
  return test::remembering(generate_sequence(options));
}

Sequence late(Sequence sequence, double s) {
  for (Frame& frame : sequence.frames) frame.time += from_s(s);
  return sequence;
}

// To 3 ms where the flight tells that; of ten flights one has a sigma of 1.3 ms.
TEST(CameraImu, FindsHowLatePicturesAre) {
  constexpr double kSigmas = 4;
  const int seeds = test::repeats(1, 10);
  double squares = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    const Sequence sequence = flight(static_cast<std::uint64_t>(seed));
    for (const double late_s : {0.0, 0.02, -0.02}) {
      const auto fit = fit_camera_to_imu(late(sequence, late_s));
      ASSERT_TRUE(fit.has_value()) << seed;
      std::printf("seed %d: late by %.2f ms, said %.2f ms, sigma %.2f ms; tilt %.2f degrees\n",
                  seed, 1e3 * late_s, 1e3 * fit->late_s, 1e3 * fit->sigma_s,
                  kDegreesPerRadian * fit->tilt_rad.norm());
      const double most_s = fit->sigma_s <= 0.001 ? 0.003 : kSigmas * fit->sigma_s;
      EXPECT_NEAR(fit->late_s, late_s, most_s) << seed;
      const double sigmas = (fit->late_s - late_s) / fit->sigma_s;
      squares += sigmas * sigmas / (3 * seeds);
      if (late_s == 0) {
        EXPECT_THAT(warnings_of(*fit), IsEmpty()) << seed;
      } else {
        EXPECT_THAT(warnings_of(*fit), ElementsAre(HasSubstr(late_s > 0 ? "later" : "earlier")));
      }
    }
  }
  EXPECT_LE(squares, 3);
}

TEST(CameraImu, FindsHowTheCameraIsTurned) {
  Sequence sequence = flight(2);
  Pose& mount = sequence.cameras[0].body_from_camera;
  const Eigen::Vector3d tilt =
      Eigen::Vector3d(0.6, -0.5, 0.62).normalized() * 3 / kDegreesPerRadian;
  mount.rotation = rotation_of(tilt) * mount.rotation;
  const auto fit = fit_camera_to_imu(sequence);
  ASSERT_TRUE(fit.has_value());
  EXPECT_LT((fit->tilt_rad - tilt).norm() * kDegreesPerRadian, 0.7)
      << fit->tilt_rad.transpose() << " where it is " << tilt.transpose();
  EXPECT_THAT(warnings_of(*fit), ElementsAre(HasSubstr("degrees from what its calibration says")));
}

// A flight that sets off. In a calm one noise hides accelerations: nothing is said of those then.
TEST(CameraImu, FindsAnImuOfTheOppositeSign) {
  SceneOptions options = test::scene(7, 4, true);
  options.width = 320;
  options.height = 240;
  options.camera_rate_hz = 20;
  options.path.rest_s = 1;
  Sequence sequence = test::remembering(generate_sequence(options));
  const ImuAlike alike = compare_imu(sequence);
  ASSERT_TRUE(alike.accelerations && alike.turns);
  EXPECT_GT(*alike.turns, 0.9);
  EXPECT_GT(*alike.accelerations, 0.8);
  EXPECT_THAT(warnings_of(alike, sequence), IsEmpty());
  const auto problem = [&sequence] {
    return test::bad_input(
        [&] { static_cast<void>(warnings_of(compare_imu(sequence), sequence)); });
  };
  for (ImuSample& sample : sequence.imu) sample.accel_m_s2 *= -1;
  EXPECT_THAT(problem(),
              testing::AllOf(HasSubstr("accelerations are opposite"), HasSubstr("--no-imu")));
  for (ImuSample& sample : sequence.imu) sample.accel_m_s2 *= -1, sample.gyro_rad_s *= -1;
  EXPECT_THAT(problem(), HasSubstr("the gyroscope turns opposite"));
  for (ImuSample& sample : sequence.imu) sample.gyro_rad_s *= -kDegreesPerRadian;
  EXPECT_THAT(problem(), HasSubstr("are these degrees/s?"));
  const Sequence calm = flight(1);
  EXPECT_THAT(warnings_of(compare_imu(calm), calm), IsEmpty());
}

TEST(CameraImu, SaysNothingWhereNothingTells) {
  SceneOptions options = test::scene(1, 2, false);
  options.path.rest_s = 2;
  options.width = 320;
  options.height = 240;
  EXPECT_FALSE(fit_camera_to_imu(generate_sequence(options)).has_value()) << "at rest";
  const ImuAlike still = compare_imu(generate_sequence(options));
  EXPECT_FALSE(still.turns || still.accelerations) << "at rest";
  Sequence blind = flight(1);
  blind.imu.clear();
  EXPECT_FALSE(fit_camera_to_imu(blind).has_value()) << "without an IMU";
  Sequence black = flight(1);
  black.image = [](std::size_t, std::size_t) {
    return GreyImage{320, 240, std::vector<std::uint8_t>(std::size_t{320} * 240)};
  };
  EXPECT_FALSE(fit_camera_to_imu(black).has_value()) << "without a picture";
}

}  // namespace
}  // namespace pirt::slam
