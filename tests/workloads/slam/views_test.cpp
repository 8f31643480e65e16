// What views alone tell: a pose among known points, and the motion between two pictures.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <span>
#include <vector>

#include "workloads/base/math/gaussian.h"
#include "workloads/base/math/random.h"
#include "workloads/slam/views/pnp.h"
#include "workloads/slam/views/two_views.h"

namespace pirt::slam {
namespace {

// What a robot sees that looks at a wall. Noise of half a pixel at a focal length of 400 and 40
// points at 3 m: some 3 m * 0.5 / 400 / sqrt(40) = 0.6 mm across, a few times that along the axis.
TEST(RobustPnp, FindsThePoseBeforeOneWallToo) {
  Random random(3);
  Gaussian gaussian(3);
  for (const double slant : {0.0, 0.3, 0.8}) {
    const Pose camera{rotation_of({0.05, slant, -0.1}), {0.5, -0.4, 0.2}};
    std::vector<PointMatch> matches;
    while (matches.size() < 40) {
      const Eigen::Vector3d point(random.uniform(-2, 6), random.uniform(-2, 2), 3.2);
      const Eigen::Vector3d p = camera.inverse() * point;
      if (p.z() < 0.5 || p.head<2>().norm() > 0.8 * p.z()) continue;
      PointMatch match{point, p.head<2>() / p.z()};
      match.ray += 0.5 / 400 * Eigen::Vector2d(gaussian.next(), gaussian.next());
      if (matches.size() % 5 == 0) match.ray += Eigen::Vector2d(random.uniform(0.1, 0.4), 0.2);
      matches.push_back(match);
    }
    const auto found = robust_pnp(matches, 4.0 / 400);
    ASSERT_TRUE(found.has_value()) << slant;
    EXPECT_EQ(found->inliers.size(), 32U) << slant;
    EXPECT_LT((found->camera.position - camera.position).norm(), 0.015) << slant;
    EXPECT_LT(angle_of(found->camera.rotation.transpose() * camera.rotation), 0.005) << slant;
  }
}

TEST(RobustPnp, FindsThePoseAmongOutliers) {
  Random random(7);
  const Pose camera{rotation_of({0.1, 0.3, -0.2}), {0.5, -0.4, 0.2}};
  std::vector<PointMatch> matches;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d p(random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(3, 6));
    PointMatch match{camera * p, p.head<2>() / p.z()};
    if (i % 4 == 0) match.ray += Eigen::Vector2d(random.uniform(0.1, 0.4), 0.2);
    matches.push_back(match);
  }
  const auto found = robust_pnp(matches, 0.005);
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->inliers.size(), 30U);
  EXPECT_LT((found->camera.position - camera.position).norm(), 1e-3);
  EXPECT_FALSE(robust_pnp(std::span(matches).first(5), 0.005).has_value());
}

constexpr double kRaySigma = 1.0 / 4000;
const Eigen::Matrix3d kNoTurn = Eigen::Matrix3d::Identity();

/// 80 points at depths of 4 to 30; of @p outliers of them, what they are anywhere in the second
/// picture.
std::vector<RayPair> pairs_seen(const Pose& second_from_first, int outliers, std::uint64_t seed) {
  Gaussian gaussian(seed);
  Random random(seed);
  std::vector<RayPair> pairs;
  for (int i = 0; i < 80; ++i) {
    const Eigen::Vector3d point =
        random.uniform(4, 30) *
        Eigen::Vector3d(random.uniform(-0.6, 0.6), random.uniform(-0.4, 0.4), 1.0);
    const Eigen::Vector3d moved = second_from_first * point;
    RayPair pair{point.hnormalized(), moved.hnormalized()};
    pair.first += kRaySigma * Eigen::Vector2d(gaussian.next(), gaussian.next());
    pair.second += kRaySigma * Eigen::Vector2d(gaussian.next(), gaussian.next());
    if (i < outliers) pair.second = {random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5)};
    pairs.push_back(pair);
  }
  return pairs;
}

/// Forward, sideways, and not at all, each with a turn of 2 degrees.
std::vector<Pose> small_motions() {
  std::vector<Pose> motions;
  for (const Eigen::Vector3d& moved : {Eigen::Vector3d(0.02, -0.01, 1.2),
                                       Eigen::Vector3d(0.4, 0.1, 0), Eigen::Vector3d(0, 0, 0)}) {
    motions.push_back({rotation_of({0.01, -0.03, 0.02}), -moved});
  }
  return motions;
}

// The error against the covariance that comes with it, squared, is 3 in the mean of what is honest
// (chi^2 of 3 degrees of freedom; of 30 trials within 1.4 at three sigma). Cauchy's weights, and a
// scale and a direction that are found from the same points, cost a factor of up to 2.
TEST(TurnOf, IsAsFarOffAsItSaysAndKnownWithoutMotionToo) {
  for (const Pose& motion : small_motions()) {
    double squares = 0;
    constexpr int kTrials = 30;
    for (std::uint64_t trial = 1; trial <= kTrials; ++trial) {
      const auto turn = turn_of(pairs_seen(motion, 0, trial), 10 * kRaySigma, kNoTurn);
      ASSERT_TRUE(turn.has_value()) << motion.position.transpose() << ", trial " << trial;
      const Eigen::Vector3d miss = vector_of(motion.rotation * turn->rotation.transpose());
      squares += miss.dot(turn->covariance.inverse() * miss) / kTrials;
    }
    EXPECT_GT(squares, 1.5) << motion.position.transpose();
    EXPECT_LT(squares, 7.5) << motion.position.transpose();
  }
}

TEST(TurnOf, IsFoundAmongOutliers) {
  for (const Pose& motion : small_motions()) {
    const auto turn = turn_of(pairs_seen(motion, 16, 1), 10 * kRaySigma, kNoTurn);
    ASSERT_TRUE(turn.has_value()) << motion.position.transpose();
    EXPECT_LT(angle_of(motion.rotation * turn->rotation.transpose()), 0.003);
    EXPECT_GE(turn->inliers, 60U);
    EXPECT_LE(turn->inliers, 70U);
  }
}

/// A wall 4 to 5 m away; of each tenth point the picture shows something before it.
std::vector<RayPair> pairs_of_a_wall(const Pose& second_from_first, std::uint64_t seed,
                                     double before_m) {
  Gaussian gaussian(seed);
  Random random(seed);
  std::vector<RayPair> pairs;
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d ray(random.uniform(-0.6, 0.6), random.uniform(-0.4, 0.4), 1.0);
    const double depth = 4.5 / (1 + 0.2 * ray.x()) - (i % 10 == 0 ? before_m : 0.0);
    RayPair pair{ray.hnormalized(), (second_from_first * (depth * ray)).hnormalized()};
    pair.first += 0.2 * kRaySigma * Eigen::Vector2d(gaussian.next(), gaussian.next());
    pair.second += 0.2 * kRaySigma * Eigen::Vector2d(gaussian.next(), gaussian.next());
    pairs.push_back(pair);
  }
  return pairs;
}

// A wall alone fits two motions as well, of which the nearer to what is expected is meant. Where a
// few points lie before it, they tell, whatever is expected.
TEST(TurnOf, IsTheRightOneOfTheTwoThatAWallFits) {
  const Pose motion{rotation_of({0.01, -0.03, 0.02}), {-0.08, 0.02, 0.03}};
  for (std::uint64_t trial = 1; trial <= 20; ++trial) {
    const auto wall = turn_of(pairs_of_a_wall(motion, trial, 0), 10 * kRaySigma,
                              motion.rotation * rotation_of({0.001, 0, 0.001}));
    ASSERT_TRUE(wall.has_value()) << trial;
    EXPECT_LT(angle_of(motion.rotation * wall->rotation.transpose()), 0.002) << trial;
    for (const auto& expected : {kNoTurn, motion.rotation}) {
      const auto room = turn_of(pairs_of_a_wall(motion, trial, 1.0), 10 * kRaySigma, expected);
      ASSERT_TRUE(room.has_value()) << trial;
      EXPECT_LT(angle_of(motion.rotation * room->rotation.transpose()), 0.002) << trial;
    }
  }
}

TEST(TurnOf, SaysNothingOfChaosOrOfFewPoints) {
  auto pairs = pairs_seen(small_motions()[0], 0, 1);
  EXPECT_EQ(turn_of(std::span(pairs).first(19), 10 * kRaySigma, kNoTurn), std::nullopt);
  Random random(1);
  for (auto& pair : pairs) pair.second = {random.uniform() - 0.5, random.uniform() - 0.5};
  EXPECT_EQ(turn_of(pairs, 2 * kRaySigma, kNoTurn), std::nullopt);
}

}  // namespace
}  // namespace pirt::slam
