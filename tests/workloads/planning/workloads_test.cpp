// Planning as workloads: maps and windows of other sizes, maps that change, and what is no grid.
#include "workloads/planning/workloads.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <limits>
#include <string>

#include "tests/support/errors.h"
#include "workloads/backends/cpu/cpu_backend.h"
#include "workloads/base/math/random.h"
#include "workloads/catalog/catalog.h"
#include "workloads/model/backend.h"
#include "workloads/planning/plain_search.h"
#include "workloads/planning/samples.h"

namespace pirt::planning {
namespace {

using testing::HasSubstr;

/// A quarter of the cells blocked at random.
Grid random_grid(int width, int height, std::uint64_t seed) {
  Random random(seed);
  Grid grid;
  grid.width = width;
  grid.height = height;
  for (int i = 0; i < width * height; ++i) {
    grid.cells.push_back(random.below(4) == 0 ? CellState::kOccupied : CellState::kFree);
  }
  return grid;
}

class OnCpu : public testing::Test {
 protected:
  explicit OnCpu(const std::string& name)
      : workload_(find_workload(name)),
        device_(make_cpu_backend()->open({"cpu", {}, "", ""})),
        kernel_(device_->prepare(workload_, {})),
        outputs_(make_tensors(workload_.outputs)) {}

  std::span<const Tensor> call(const std::vector<Tensor>& inputs) {
    kernel_->bind(inputs, outputs_);
    kernel_->execute(1);
    return outputs_;
  }
  Path plan(const Grid& grid, double radius, Cell start, Cell goal) {
    return path_of(call(plan_inputs(grid, radius, start, goal)));
  }

  const Workload& workload_;
  std::unique_ptr<Device> device_;
  std::unique_ptr<Kernel> kernel_;
  std::vector<Tensor> outputs_;
};

class PlanPathOnCpu : public OnCpu {
 protected:
  PlanPathOnCpu() : OnCpu("plan_path") {}
};

// One kernel, as one robot has it: each call with another map, radius or query than the one before.
TEST_F(PlanPathOnCpu, AnswersForTheMapOfTheCall) {
  Random random(7);
  int found = 0;
  for (int i = 0; i < 12; ++i) {
    const Grid grid = random_grid(40 + i % 3, 30 - i % 4, static_cast<std::uint64_t>(i / 2));
    const double radius = i % 2 == 0 ? 0 : 1;
    const auto cell = [&] {
      return Cell{static_cast<int>(random.below(30)), static_cast<int>(random.below(20))};
    };
    const Cell start = cell(), goal = cell();
    const Path got = plan(grid, radius, start, goal);
    const Path want = plan_plainly(PlainSearch::kDijkstra, grid.width, grid.height,
                                   passable_cells(grid, radius), start, goal);
    EXPECT_EQ(got.status, want.status) << i;
    EXPECT_NEAR(got.length, want.length, 1e-9) << i;
    EXPECT_EQ(got.cells.size(), want.cells.size()) << i;
    found += want.status == PathStatus::kFound ? 1 : 0;
  }
  EXPECT_GE(found, 3);
}

TEST_F(PlanPathOnCpu, SaysWhichEndIsBlockedAndWhatCannotBeReached) {
  Grid grid = random_grid(3, 1, 1);
  grid.cells = {CellState::kFree, CellState::kOccupied, CellState::kFree};
  EXPECT_EQ(plan(grid, 0, {1, 0}, {0, 0}).status, PathStatus::kStartBlocked);
  EXPECT_EQ(plan(grid, 0, {0, 0}, {1, 0}).status, PathStatus::kGoalBlocked);
  EXPECT_EQ(plan(grid, 0, {0, 0}, {2, 0}).status, PathStatus::kUnreachable);
  // Beside the map nothing is known, and nothing is beyond the room for maps.
  EXPECT_EQ(plan(grid, 0, {0, 0}, {3, 0}).status, PathStatus::kGoalBlocked);
  EXPECT_EQ(plan(grid, 0, {0, 0}, {kMapWidth, 0}).status, PathStatus::kGoalBlocked);
  const Path none = plan(grid, 0, {-1, 0}, {0, 0});
  EXPECT_EQ(none.status, PathStatus::kStartBlocked);
  EXPECT_TRUE(none.cells.empty());
  EXPECT_EQ(none.length, 0);
}

TEST_F(PlanPathOnCpu, RefusesWhatIsNoMap) {
  const Grid grid = random_grid(4, 4, 1);
  auto inputs = plan_inputs(grid, 0, {0, 0}, {3, 3});
  inputs[0].as<std::uint8_t>()[5] = 3;
  EXPECT_THAT(test::bad_input([&] { call(inputs); }),
              HasSubstr("0 is free, 1 occupied and 2 unknown"));
  inputs = plan_inputs(grid, 0, {0, 0}, {3, 3});
  for (const double radius : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    inputs[1].as<double>()[0] = radius;
    EXPECT_THAT(test::bad_input([&] { call(inputs); }), HasSubstr("radius"));
  }
  const Grid wide = random_grid(kMapWidth + 1, 1, 1);
  EXPECT_THAT(test::bad_input([&] {
                static_cast<void>(plan_inputs(wide, 0, {0, 0}, {0, 0}));
              }),
              HasSubstr("641 x 1"));
  // It is as good as before.
  EXPECT_EQ(plan(grid, 0, {0, 0}, {0, 0}).status,
            grid.at({0, 0}) == CellState::kFree ? PathStatus::kFound : PathStatus::kStartBlocked);
}

// A move through a wall is shorter, and a detour longer, than what is right.
TEST(PlanPathWorkload, JudgesByTheMap) {
  const Workload& workload = find_workload("plan_path");
  Data data;
  Grid grid = random_grid(5, 3, 1);
  grid.cells.assign(15, CellState::kFree);
  grid.cells[grid.index({2, 1})] = CellState::kOccupied;
  data.inputs = plan_inputs(grid, 0, {0, 1}, {4, 1});
  const auto expected = workload.reference(data);
  const auto judged = [&](const std::vector<Cell>& cells) {
    auto outputs = make_tensors(workload.outputs);
    outputs[1].set_rows(std::ssize(cells));
    for (std::size_t i = 0; i < cells.size(); ++i) {
      outputs[1].as<std::int32_t>()[2 * i] = cells[i].x;
      outputs[1].as<std::int32_t>()[2 * i + 1] = cells[i].y;
    }
    outputs[2].as<double>()[0] = path_length(cells);
    const PlayedFrame frame{.data = &data, .outputs = outputs, .expected = expected};
    return workload.judge({&frame, 1});
  };
  EXPECT_FALSE(judged({{0, 1}, {0, 0}, {1, 0}, {2, 0}, {3, 0}, {4, 0}, {4, 1}}).ok) << "a detour";
  EXPECT_TRUE(judged({{0, 1}, {1, 2}, {2, 2}, {3, 2}, {4, 1}}).ok);
  EXPECT_TRUE(judged({{0, 1}, {1, 0}, {2, 0}, {3, 0}, {4, 1}}).ok) << "as long on the other side";
  EXPECT_FALSE(judged({{0, 1}, {1, 1}, {2, 1}, {3, 1}, {4, 1}}).ok) << "through the wall";
  EXPECT_FALSE(judged({{0, 1}, {1, 0}, {2, 0}, {3, 1}, {4, 1}}).ok) << "a corner cut, as long";
  EXPECT_FALSE(judged({}).ok);
}

class AvoidOnCpu : public OnCpu {
 protected:
  AvoidOnCpu() : OnCpu("avoid_obstacles") {}
};

TEST_F(AvoidOnCpu, AWindowMayBeSmaller) {
  for (int moment = 0; moment < 4; ++moment) {
    AvoidSample sample = avoid_sample(3, moment);
    sample.window.origin = {-7, 11};
    sample.robot.position.x -= 7, sample.robot.position.y += 11;
    sample.target.x -= 7, sample.target.y += 11;
    for (auto& each : sample.moving) each.position.x -= 7, each.position.y += 11;
    const Grid window = window_of(sample.window, sample.robot.position, 6);
    ASSERT_EQ(window.width, 120);
    const VelocityCommand got =
        command_of(call(avoid_inputs(sample.robot, window, sample.moving, sample.target)));
    const VelocityCommand want =
        avoid_obstacles(sample.robot, window, sample.moving, sample.target, {});
    EXPECT_NEAR(got.speed_mps, want.speed_mps, 1e-9) << moment;
    EXPECT_NEAR(got.turn_rate_rps, want.turn_rate_rps, 1e-9) << moment;
  }
}

TEST_F(AvoidOnCpu, TakesTheNearestOfACrowd) {
  AvoidSample sample = avoid_sample(1, 0);
  const auto near = sample.moving;
  for (int i = 0; i < kMostMoving; ++i)
    sample.moving.insert(sample.moving.begin(), {{90, 90}, {}, 1});
  const auto inputs = avoid_inputs(sample.robot, sample.window, sample.moving, sample.target);
  EXPECT_EQ(inputs[4].rows(), kMostMoving);
  const auto few = avoid_inputs(sample.robot, sample.window, near, sample.target);
  const VelocityCommand crowded = command_of(call(inputs));
  const VelocityCommand alone = command_of(call(few));
  EXPECT_EQ(crowded.speed_mps, alone.speed_mps);
  EXPECT_EQ(crowded.turn_rate_rps, alone.turn_rate_rps);
}

TEST_F(AvoidOnCpu, RefusesWhatIsNoWindow) {
  const AvoidSample sample = avoid_sample(1, 0);
  auto inputs = avoid_inputs(sample.robot, sample.window, sample.moving, sample.target);
  inputs[1].as<double>()[2] = 0;
  EXPECT_THAT(test::bad_input([&] { call(inputs); }), HasSubstr("side of 0 m"));
  Grid turned = sample.window;
  turned.yaw_rad = 1;
  EXPECT_THAT(
      test::bad_input([&] { static_cast<void>(avoid_inputs(sample.robot, turned, {}, {})); }),
      HasSubstr("yaw 0"));
}

// What goes on at full speed towards the wall in front of it, or faster than it can, is refused.
TEST(AvoidObstaclesWorkload, JudgesByTheWindow) {
  const Workload& workload = find_workload("avoid_obstacles");
  AvoidSample sample = avoid_sample(1, 0);
  sample.robot.heading_rad = 0;
  sample.robot.speed_mps = 0.9;
  sample.robot.turn_rate_rps = 0;
  const Cell at = sample.window.cell_of(sample.robot.position);
  for (int y = 0; y < sample.window.height; ++y) {
    sample.window.cells[sample.window.index({at.x + 11, y})] = CellState::kOccupied;
  }
  Data data;
  data.inputs = avoid_inputs(sample.robot, sample.window, sample.moving, sample.target);
  const auto judged = [&](double speed, double turn) {
    auto outputs = make_tensors(workload.outputs);
    outputs[0].as<double>()[0] = speed;
    outputs[0].as<double>()[1] = turn;
    const PlayedFrame frame{.data = &data, .outputs = outputs, .expected = outputs};
    return workload.judge({&frame, 1});
  };
  EXPECT_TRUE(judged(0.75, 0).ok) << judged(0.75, 0).detail;
  EXPECT_FALSE(judged(1.0, 0).ok) << "0.58 m to a wall, 0.25 m of them the robot's, 0.43 m to stop";
  EXPECT_FALSE(judged(0.5, 0).ok) << "braking harder than it can";
  EXPECT_FALSE(judged(0.75, 1.4).ok) << "turning faster than it can";
}

TEST(AvoidObstaclesWorkload, JudgesARobotThatRollsBackwards) {
  const Workload& workload = find_workload("avoid_obstacles");
  AvoidSample sample = avoid_sample(1, 0);
  sample.robot.heading_rad = 0;
  sample.robot.speed_mps = -0.5;
  sample.robot.turn_rate_rps = 0;
  std::ranges::fill(sample.window.cells, CellState::kFree);
  const auto judged = [&](double speed) {
    Data data;
    data.inputs = avoid_inputs(sample.robot, sample.window, sample.moving, sample.target);
    auto outputs = make_tensors(workload.outputs);
    outputs[0].as<double>()[0] = speed;
    outputs[0].as<double>()[1] = 0;
    const PlayedFrame frame{.data = &data, .outputs = outputs, .expected = outputs};
    return workload.judge({&frame, 1});
  };
  EXPECT_TRUE(judged(-0.35).ok) << judged(-0.35).detail;
  EXPECT_FALSE(judged(0).ok) << "braking harder than it can";
  const Cell at = sample.window.cell_of(sample.robot.position);
  sample.window.cells[sample.window.index({at.x - 4, at.y})] = CellState::kOccupied;
  EXPECT_FALSE(judged(-0.35).ok) << "a wall behind it";
}

}  // namespace
}  // namespace pirt::planning
