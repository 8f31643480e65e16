// The local planner among people who do not look where they go.
#include "workloads/planning/avoid_obstacles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "tests/support/errors.h"
#include "workloads/base/math/random.h"
#include "workloads/planning/path_follower.h"
#include "workloads/planning/plan_path.h"

namespace pirt::planning {
namespace {

constexpr double kSideM = 10;
constexpr double kPersonM = 0.25;
constexpr Point kStart = {1, 5};
constexpr Point kGoal = {9, 5};
constexpr double kReachedM = 0.2;

/// Not std::hypot: nothing here overflows, and it takes ten times as long.
double quick_distance(Point a, Point b) {
  return std::sqrt((a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y));
}

/// An empty room with walls around it.
Grid room() {
  Grid grid;
  grid.unit = Unit::kMetres;
  grid.resolution = 0.1;
  grid.width = grid.height = 102;
  grid.origin = {-0.1, -0.1};
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      const bool wall = x == 0 || y == 0 || x == grid.width - 1 || y == grid.height - 1;
      grid.cells.push_back(wall ? CellState::kOccupied : CellState::kFree);
    }
  }
  return grid;
}

/// 20 people of 0.3 to 1.0 m/s, each on its way to one random place after another; they walk
/// through each other and through the robot.
class People {
 public:
  explicit People(std::uint64_t seed) : random_(seed) {
    while (walkers_.size() < 20) {
      const Point at = anywhere();
      if (quick_distance(at, kStart) < 1) continue;
      walkers_.push_back({{at, {}, kPersonM}, anywhere(), random_.uniform(0.3, 1.0)});
      head_for(walkers_.back());
    }
  }

  void move(double seconds) {
    for (auto& walker : walkers_) {
      if (quick_distance(walker.disc.position, walker.place) < walker.speed_mps * seconds) {
        walker.place = anywhere();
        head_for(walker);
      }
      walker.disc.position.x += walker.disc.velocity.x * seconds;
      walker.disc.position.y += walker.disc.velocity.y * seconds;
    }
  }

  [[nodiscard]] std::vector<MovingObstacle> seen() const {
    std::vector<MovingObstacle> discs;
    for (const auto& walker : walkers_) discs.push_back(walker.disc);
    return discs;
  }
  [[nodiscard]] bool touch(Point robot, double radius_m) const {
    return std::ranges::any_of(walkers_, [&](const Walker& walker) {
      return quick_distance(walker.disc.position, robot) < walker.disc.radius_m + radius_m;
    });
  }

 private:
  struct Walker {
    MovingObstacle disc;
    Point place;
    double speed_mps;
  };
  Point anywhere() {
    return {random_.uniform(0.3, kSideM - 0.3), random_.uniform(0.3, kSideM - 0.3)};
  }
  static void head_for(Walker& walker) {
    const double way = std::max(1e-9, quick_distance(walker.disc.position, walker.place));
    walker.disc.velocity = {walker.speed_mps * (walker.place.x - walker.disc.position.x) / way,
                            walker.speed_mps * (walker.place.y - walker.disc.position.y) / way};
  }

  Random random_;
  std::vector<Walker> walkers_;
};

struct Outcome {
  bool touched_while_moving = false;
  bool reached = false;
  bool within_limits = true;
};

void integrate(RobotState& robot, double seconds) {
  // Small steps, unlike the planner's arcs.
  robot.heading_rad += robot.turn_rate_rps * seconds / 2;
  robot.position.x += robot.speed_mps * std::cos(robot.heading_rad) * seconds;
  robot.position.y += robot.speed_mps * std::sin(robot.heading_rad) * seconds;
  robot.heading_rad += robot.turn_rate_rps * seconds / 2;
}

/// @param command  The velocity that is chosen from the robot's state and the people that it sees.
template <typename Command>
Outcome drive(std::uint64_t seed, const Command& command) {
  constexpr double kStepS = 0.01;
  const AvoidOptions options;
  const RobotLimits& limits = options.limits;
  People people(seed);
  RobotState robot{kStart};
  Outcome outcome;
  for (int period = 0; period < 600 && !outcome.reached; ++period) {
    const VelocityCommand next = command(robot, people.seen());
    outcome.within_limits = outcome.within_limits && next.speed_mps >= 0 &&
                            next.speed_mps <= limits.most_speed_mps + 1e-9 &&
                            std::abs(next.turn_rate_rps) <= limits.most_turn_rate_rps + 1e-9 &&
                            std::abs(next.speed_mps - robot.speed_mps) <=
                                limits.acceleration_mps2 * options.period_s + 1e-9 &&
                            std::abs(next.turn_rate_rps - robot.turn_rate_rps) <=
                                limits.turn_acceleration_rps2 * options.period_s + 1e-9;
    robot.speed_mps = next.speed_mps;
    robot.turn_rate_rps = next.turn_rate_rps;
    for (int step = 0; step < 10; ++step) {
      integrate(robot, kStepS);
      people.move(kStepS);
      const bool moves = robot.speed_mps > 0 || robot.turn_rate_rps != 0;
      if (moves && people.touch(robot.position, limits.radius_m)) {
        outcome.touched_while_moving = true;
      }
    }
    outcome.reached = quick_distance(robot.position, kGoal) < kReachedM;
  }
  return outcome;
}

TEST(AvoidObstacles, TouchesNobodyWhileItMovesAndArrives) {
  const Grid map = room();
  int reached = 0;
  int straight_touched = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const auto avoiding = drive(seed, [&](const RobotState& robot, const auto& people) {
      return avoid_obstacles(robot, window_of(map, robot.position, 4), people, kGoal, {});
    });
    EXPECT_FALSE(avoiding.touched_while_moving) << "seed " << seed;
    EXPECT_TRUE(avoiding.within_limits) << "seed " << seed;
    reached += avoiding.reached ? 1 : 0;
    // What a robot meets that drives straight at the same speeds.
    const auto straight = drive(seed, [](const RobotState& robot, const auto&) {
      return VelocityCommand{std::min(1.0, robot.speed_mps + 0.15), 0};
    });
    straight_touched += straight.touched_while_moving ? 1 : 0;
  }
  EXPECT_GE(reached, 90);
  EXPECT_GE(straight_touched, 50);
  RecordProperty("reached", reached);
  RecordProperty("straight_touched", straight_touched);
}

TEST(AvoidObstacles, FollowsAPathRoundAWall) {
  Grid map = room();
  for (int y = 30; y < 102; ++y) map.cells[map.index({50, y})] = CellState::kOccupied;
  const AvoidOptions options;
  const PreparedMap prepared(map, options.limits.radius_m);
  const auto path = PathPlanner(prepared).plan(map.cell_of(kStart), map.cell_of(kGoal));
  ASSERT_EQ(path.status, PathStatus::kFound);
  std::vector<Point> points;
  for (const Cell cell : path.cells) points.push_back(map.centre_of(cell));
  PathFollower follower(points);
  RobotState robot{kStart};
  for (int period = 0; period < 600 && quick_distance(robot.position, kGoal) > kReachedM;
       ++period) {
    const auto command = avoid_obstacles(robot, window_of(map, robot.position, 4), {},
                                         follower.ahead(robot.position, 0.8), options);
    robot.speed_mps = command.speed_mps;
    robot.turn_rate_rps = command.turn_rate_rps;
    for (int step = 0; step < 10; ++step) integrate(robot, 0.01);
    ASSERT_TRUE(prepared.passable(map.cell_of(robot.position))) << "too close to a wall";
  }
  EXPECT_LT(quick_distance(robot.position, kGoal), kReachedM);
}

TEST(AvoidObstacles, StandsWhereNothingIsSafe) {
  const Grid map = room();
  const std::vector<MovingObstacle> around = {{{1.5, 5}, {}, kPersonM}, {{0.6, 5}, {}, kPersonM}};
  const auto command = avoid_obstacles({kStart}, window_of(map, kStart, 4), around, kGoal, {});
  EXPECT_EQ(command.speed_mps, 0);
  EXPECT_EQ(command.turn_rate_rps, 0);
}

TEST(AvoidObstacles, BrakesARobotThatIsBeyondItsLimits) {
  const Point middle = {5, 5};
  const Grid window = window_of(room(), middle, 4);
  const auto command = [&](double speed, double turn) {
    return avoid_obstacles({middle, 0, speed, turn}, window, {}, kGoal, {});
  };
  EXPECT_DOUBLE_EQ(command(-0.5, 0).speed_mps, -0.35);
  EXPECT_DOUBLE_EQ(command(1.3, 0).speed_mps, 1.15);
  EXPECT_DOUBLE_EQ(command(0.5, 3).turn_rate_rps, 2.4);
  EXPECT_DOUBLE_EQ(command(0.5, -3).turn_rate_rps, -2.4);
}

// As a measurement may be that went wrong: it ends, with a command that brakes.
TEST(AvoidObstacles, EndsWhateverTheRobotIsSaidToDo) {
  const Grid map = room();
  const double none = std::numeric_limits<double>::quiet_NaN();
  for (const double speed : {1e300, 1e9, 91.0, -1e300, none}) {
    for (const double turn : {0.0, 1e300, -1e9, none}) {
      for (const Point place : {Point{1e6, 1e6}, Point{5, 5}, Point{none, 0}}) {
        const RobotState robot{place, 0, speed, turn};
        const VelocityCommand command = avoid_obstacles(robot, map, {}, kGoal, {});
        if (speed > 90) {
          EXPECT_LE(command.speed_mps, speed);
        }
      }
    }
  }
}

TEST(Window, IsThePartOfTheMapAroundThePlace) {
  const Grid map = room();
  const Grid window = window_of(map, {0.05, 5.05}, 2);
  EXPECT_EQ(window.width, 20);
  // Columns left of the map are unknown, then comes the wall.
  EXPECT_EQ(window.at(window.cell_of({-0.15, 5.05})), CellState::kUnknown);
  EXPECT_EQ(window.at(window.cell_of({-0.05, 5.05})), CellState::kOccupied);
  EXPECT_EQ(window.at(window.cell_of({0.05, 5.05})), CellState::kFree);
  Grid cells = map;
  cells.unit = Unit::kCells;
  EXPECT_NE(test::bad_input([&] { static_cast<void>(window_of(cells, {1, 1}, 2)); }), "");
}

}  // namespace
}  // namespace pirt::planning
