#include "workloads/planning/path_follower.h"

#include <gtest/gtest.h>

namespace pirt::planning {
namespace {

TEST(PathFollower, GoesAlongThePathToItsEnd) {
  PathFollower path({{0, 0}, {1, 0}, {1, 1}});
  EXPECT_FALSE(path.empty());
  EXPECT_DOUBLE_EQ(path.ahead({0.1, 0.2}, 0.5).x, 0.5);
  EXPECT_DOUBLE_EQ(path.ahead({0.1, 0.2}, 1.25).y, 0.25);
  EXPECT_DOUBLE_EQ(path.ahead({0.9, 0.1}, 5).y, 1);
  EXPECT_TRUE(PathFollower().empty());
}

// 4 m along a wall of 0.2 m, round its end, and back on the other side. Halfway the nearest points
// are those behind the wall, once the robot keeps 0.3 m from its own side of the path.
TEST(PathFollower, IsNotDrawnThroughAThinWall) {
  std::vector<Point> points;
  for (int i = 0; i <= 40; ++i) points.push_back({0.1 * i, 0});
  for (int i = 1; i <= 6; ++i) points.push_back({4, 0.1 * i});
  for (int i = 1; i <= 40; ++i) points.push_back({4 - 0.1 * i, 0.6});
  PathFollower path(points);
  for (int i = 0; i <= 20; ++i) {
    const Point target = path.ahead({0.1 * i, 0.35}, 0.5);
    EXPECT_NEAR(target.x, 0.1 * i + 0.5, 1e-9) << i;
    EXPECT_EQ(target.y, 0) << i;
  }
  // A robot that nobody asked for a while has come further than it looks ahead.
  EXPECT_NEAR(path.ahead({3.5, 0.1}, 0.5).x, 4, 1e-9);
}

}  // namespace
}  // namespace pirt::planning
