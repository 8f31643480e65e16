// Generated sequences: their truth is exact, their sensors have the faults that they should have.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/errors.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/inputs/scene/room.h"

namespace pirt {
namespace {

TEST(RobotPath, VelocityAndTurnAreTheDerivatives) {
  for (const auto shape : {PathShape::kLoop, PathShape::kTurns, PathShape::kRing}) {
    const RobotPath path({shape, 20.0, 2.0, 5});
    constexpr double kStep = 1e-4;
    for (double t = 0.5; t < 19.5; t += 0.37) {
      const BodyMotion before = path.at(t - kStep);
      const BodyMotion here = path.at(t);
      const BodyMotion after = path.at(t + kStep);
      EXPECT_LT(
          ((after.body.position - before.body.position) / (2 * kStep) - here.velocity_m_s).norm(),
          1e-5);
      EXPECT_LT(((after.velocity_m_s - before.velocity_m_s) / (2 * kStep) - here.acceleration_m_s2)
                    .norm(),
                1e-4);
      const Eigen::Vector3d turn =
          vector_of(before.body.rotation.transpose() * after.body.rotation) / (2 * kStep);
      EXPECT_LT((turn - here.turn_rad_s).norm(), 1e-5);
    }
  }
}

TEST(RobotPath, RestsFirstThenMovesWithinItsLimitsAwayFromFurniture) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const RobotPath path({PathShape::kLoop, 60.0, 2.0, seed});
    const Room room(seed);
    EXPECT_LT(path.at(1.0).velocity_m_s.norm(), 1e-9);
    double way_m = 0;
    for (double t = 0; t < 60; t += 0.02) {
      const BodyMotion motion = path.at(t);
      const double speed = motion.velocity_m_s.norm();
      way_m += 0.02 * speed;
      EXPECT_LE(speed, 1.6);
      if (t > 4.5) {
        EXPECT_GE(speed, 0.45);
      }
      EXPECT_LE(motion.turn_rad_s.norm() * kDegreesPerRadian, 61);
      for (const auto& box : room.furniture()) {
        const auto& p = motion.body.position;
        EXPECT_TRUE((p.array() < box.low.array()).any() || (p.array() > box.high.array()).any());
      }
    }
    EXPECT_GT(way_m, 40);
    EXPECT_LT(way_m, 80);
  }
}

TEST(RobotPath, LeadsAroundTheCorridorAndBackToWhereItBegan) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const RobotPath path({PathShape::kRing, 120.0, 2.0, seed});
    const Room room(seed, RoomKind::kCorridor);
    const Eigen::Vector3d start = path.at(0).body.position;
    double farthest = 0;
    double again = 1e9;
    for (double t = 0; t < 120; t += 0.02) {
      const BodyMotion motion = path.at(t);
      const auto& p = motion.body.position;
      EXPECT_LE(motion.velocity_m_s.norm(), 2.3);
      EXPECT_LE(motion.turn_rad_s.norm() * kDegreesPerRadian, 61);
      farthest = std::max(farthest, (p - start).norm());
      if (t > 30) again = std::min(again, (p - start).norm());
      EXPECT_TRUE((p.array() > 0.3).all() &&
                  (p.array() < size_of(RoomKind::kCorridor).array() - 0.3).all());
      for (const auto& box : room.furniture()) {
        EXPECT_TRUE((p.array() < box.low.array() - 0.3).any() ||
                    (p.array() > box.high.array() + 0.3).any())
            << t;
      }
    }
    EXPECT_GT(farthest, 25);
    EXPECT_LT(again, 0.6);
  }
}

TEST(GenerateSequence, SameSeedSameBytesOtherSeedOthers) {
  auto options = test::scene(4, 1.0);
  const auto a = generate_sequence(options);
  const auto b = generate_sequence(options);
  EXPECT_EQ(a.image(20, 0).pixels, b.image(20, 0).pixels);
  EXPECT_EQ(a.imu[100].gyro_rad_s, b.imu[100].gyro_rad_s);
  options.path.seed = 5;
  EXPECT_NE(a.image(20, 0).pixels, generate_sequence(options).image(20, 0).pixels);
}

// At rest two pictures differ by noise alone: sigma 2 each, so sqrt(8) of the difference (and a
// little for rounding: 1/12 each).
TEST(GenerateSequence, PicturesHaveTheNoiseThatWasAsked) {
  auto options = test::scene(6, 1.0);
  options.path.rest_s = 0.9;
  const auto sequence = generate_sequence(options);
  const auto a = sequence.image(3, 0);
  const auto b = sequence.image(9, 0);
  double squares = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    squares += std::pow(static_cast<double>(a.pixels[i]) - b.pixels[i], 2);
  }
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(a.pixels.size())), std::sqrt(8.0 + 1.0 / 6),
              0.05);
}

// A gyroscope at rest: its mean is the bias, its spread the density times the root of the rate.
TEST(GenerateSequence, ImuHasEurocsDensities) {
  const auto sequence = generate_sequence(test::scene(8, 10.0));
  double squares = 0;
  const std::size_t count = 380;  // at rest
  for (std::size_t i = 0; i < count; ++i) {
    squares += (sequence.imu[i].gyro_rad_s - sequence.truth[i].gyro_bias_rad_s).squaredNorm();
  }
  const double sigma = std::sqrt(squares / (3.0 * static_cast<double>(count)));
  EXPECT_NEAR(sigma, 1.6968e-4 * std::sqrt(200.0), 0.1 * sigma);
}

TEST(FloorMap, TheGoalAndTheStartAreFree) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const auto options = test::scene(seed, 10.0);
    const FloorMap map = floor_map(options);
    EXPECT_TRUE(map.pgm.starts_with("P5\n164 164\n255\n"));
    const std::string cells = map.pgm.substr(map.pgm.size() - 164 * 164);
    const auto at = [&](double x, double y) {
      const int column = static_cast<int>(std::floor((x + 0.1) / 0.05));
      const int row = 163 - static_cast<int>(std::floor((y + 0.1) / 0.05));
      return static_cast<unsigned char>(cells[static_cast<std::size_t>(row * 164 + column)]);
    };
    double x = 0;
    double y = 0;
    ASSERT_EQ(std::sscanf(map.goal_yaml.c_str(), "goal: [%lf, %lf]", &x, &y), 2);
    EXPECT_EQ(at(x, y), 254);
    const auto start = RobotPath(options.path).at(0).body.position;
    EXPECT_EQ(at(start.x(), start.y()), 254);
    EXPECT_EQ(at(4.0, 4.0), 0);    // the block in the middle
    EXPECT_EQ(at(-0.05, 4.0), 0);  // a wall
  }
}

TEST(CheckOptions, NamesWhatIsOutOfRange) {
  auto options = test::scene(1, 0.1);
  EXPECT_THAT(test::bad_input([&] { check_options(options); }), testing::HasSubstr("duration"));
  options = test::scene(1, 10);
  options.exposure_ms = 100;
  EXPECT_THAT(test::bad_input([&] { check_options(options); }), testing::HasSubstr("exposure"));
}

}  // namespace
}  // namespace pirt
