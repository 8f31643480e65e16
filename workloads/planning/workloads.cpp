#include "workloads/planning/workloads.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/model/host_function.h"
#include "workloads/planning/changing_map.h"
#include "workloads/planning/plain_search.h"
#include "workloads/planning/samples.h"
#include "workloads/planning/verdicts.h"

namespace pirt::planning {
namespace {

constexpr double kRadiusM = 0.22;

void put_grid(const Grid& grid, Tensor& tensor) {
  if (grid.height > tensor.dim(0) || grid.width > tensor.dim(1)) {
    throw_bad_input(
        fmt::format("a map of {} x {} cells does not fit into one of {} x {}; cut it, "
                    "or save it with larger cells",
                    grid.width, grid.height, tensor.dim(1), tensor.dim(0)));
  }
  const auto cells = tensor.as<std::uint8_t>();
  std::ranges::fill(cells, static_cast<std::uint8_t>(CellState::kUnknown));
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      cells[static_cast<std::size_t>(y * tensor.dim(1) + x)] =
          static_cast<std::uint8_t>(grid.at({x, y}));
    }
  }
}

void put_cell(Cell cell, Tensor& tensor) {
  tensor.as<std::int32_t>()[0] = cell.x;
  tensor.as<std::int32_t>()[1] = cell.y;
}

Cell cell_of(const Tensor& tensor) {
  return {tensor.as<std::int32_t>()[0], tensor.as<std::int32_t>()[1]};
}

Point point_of(std::span<const double> values) { return {values[0], values[1]}; }

void put_path(const Path& path, std::span<Tensor> outputs) {
  outputs[0].as<std::int32_t>()[0] = static_cast<std::int32_t>(path.status);
  outputs[1].set_rows(std::ssize(path.cells));
  const auto cells = outputs[1].as<std::int32_t>();
  for (std::size_t i = 0; i < path.cells.size(); ++i) {
    cells[2 * i] = path.cells[i].x;
    cells[2 * i + 1] = path.cells[i].y;
  }
  outputs[2].as<double>()[0] = path.length;
}

/// Plans on the map of the call, which it expects to be much like that of the call before.
class Planner {
 public:
  void plan(std::span<const Tensor> inputs, std::span<Tensor> outputs) {
    const double radius = checked_radius(inputs[1].as<double>()[0]);
    if (!planner_ || radius != map_->radius()) {
      Grid grid = grid_of(inputs[0]);
      planner_.reset();
      map_.emplace(std::move(grid), radius);
      planner_.emplace(map_->prepared());
    } else {
      map_->become(inputs[0].as<std::uint8_t>());
    }
    put_path(planner_->plan(cell_of(inputs[2]), cell_of(inputs[3])), outputs);
  }

 private:
  std::optional<ChangingMap> map_;
  std::optional<PathPlanner> planner_;
};

void avoid(std::span<const Tensor> inputs, std::span<Tensor> outputs) {
  const AvoidInputs given = avoid_inputs_of(inputs);
  const VelocityCommand command =
      avoid_obstacles(given.robot, given.window, given.moving, given.target, {});
  outputs[0].as<double>()[0] = command.speed_mps;
  outputs[0].as<double>()[1] = command.turn_rate_rps;
}

}  // namespace

Grid grid_of(const Tensor& tensor) {
  Grid grid;
  grid.height = static_cast<int>(tensor.dim(0));
  grid.width = static_cast<int>(tensor.dim(1));
  const auto cells = tensor.as<std::uint8_t>();
  check_cells(cells);
  grid.cells.reserve(cells.size());
  for (const std::uint8_t cell : cells) grid.cells.push_back(static_cast<CellState>(cell));
  return grid;
}

double checked_radius(double radius) {
  if (radius >= 0 && std::isfinite(radius)) return radius;
  throw_bad_input(fmt::format("a robot's radius cannot be {} cells", radius));
}

AvoidInputs avoid_inputs_of(std::span<const Tensor> inputs) {
  AvoidInputs given{.window = grid_of(inputs[0]), .robot = {}, .target = {}, .moving = {}};
  const auto place = inputs[1].as<double>();
  given.window.unit = Unit::kMetres;
  given.window.origin = point_of(place);
  given.window.resolution = place[2];
  if (!(place[2] > 0 && std::isfinite(place[2]))) {
    throw_bad_input(fmt::format("a window's cells cannot have a side of {} m", place[2]));
  }
  const auto robot = inputs[2].as<double>();
  given.robot = {point_of(robot), robot[2], robot[3], robot[4]};
  given.target = point_of(inputs[3].as<double>());
  const auto moving = inputs[4].used<double>();
  for (std::size_t i = 0; i < moving.size(); i += 5) {
    given.moving.push_back(
        {point_of(moving.subspan(i)), point_of(moving.subspan(i + 2)), moving[i + 4]});
  }
  return given;
}

std::vector<Tensor> plan_inputs(const Grid& grid, double radius, Cell start, Cell goal) {
  auto inputs = make_tensors(specs()[0].inputs);
  put_grid(grid, inputs[0]);
  inputs[1].as<double>()[0] = radius / grid.resolution;
  put_cell(start, inputs[2]);
  put_cell(goal, inputs[3]);
  return inputs;
}

Path path_of(std::span<const Tensor> outputs) {
  Path path;
  path.status = static_cast<PathStatus>(outputs[0].as<std::int32_t>()[0]);
  const auto cells = outputs[1].used<std::int32_t>();
  for (std::size_t i = 0; i < cells.size(); i += 2) path.cells.push_back({cells[i], cells[i + 1]});
  path.length = outputs[2].as<double>()[0];
  return path;
}

std::vector<Tensor> avoid_inputs(const RobotState& robot, const Grid& window,
                                 std::span<const MovingObstacle> moving, Point target) {
  if (window.unit != Unit::kMetres || window.yaw_rad != 0) {
    throw_bad_input("a window is cut from a map in metres that is not turned (yaw 0)");
  }
  auto inputs = make_tensors(specs()[1].inputs);
  put_grid(window, inputs[0]);
  const auto put = [&](std::size_t input, std::initializer_list<double> values) {
    std::ranges::copy(values, inputs[input].as<double>().begin());
  };
  // The lower left corner is that of the cells beside the window, too.
  put(1, {window.origin.x, window.origin.y - (kWindowSide - window.height) * window.resolution,
          window.resolution});
  put(2, {robot.position.x, robot.position.y, robot.heading_rad, robot.speed_mps,
          robot.turn_rate_rps});
  put(3, {target.x, target.y});
  std::vector<MovingObstacle> nearest(moving.begin(), moving.end());
  std::ranges::stable_sort(nearest, {}, [&](const MovingObstacle& other) {
    return std::hypot(other.position.x - robot.position.x, other.position.y - robot.position.y) -
           other.radius_m;
  });
  nearest.resize(std::min<std::size_t>(nearest.size(), kMostMoving));
  inputs[4].set_rows(std::ssize(nearest));
  for (auto row = inputs[4].as<double>().begin(); const MovingObstacle& each : nearest) {
    for (const double value :
         {each.position.x, each.position.y, each.velocity.x, each.velocity.y, each.radius_m}) {
      *row++ = value;
    }
  }
  return inputs;
}

VelocityCommand command_of(std::span<const Tensor> outputs) {
  return {outputs[0].as<double>()[0], outputs[0].as<double>()[1]};
}

std::vector<Workload> all() {
  auto all = specs();
  Workload& plan = all[0];
  auto planning = std::make_shared<HostFunction>();
  planning->prepare = [](std::span<const Tensor>) -> KernelFunction {
    return [planner = std::make_shared<Planner>()](auto inputs, auto outputs) {
      planner->plan(inputs, outputs);
    };
  };
  plan.operation = std::move(planning);
  plan.make_data = [](const DataRequest& request) {
    const PlanSample sample = plan_sample(request.seed, request.frame);
    Data data;
    data.inputs = plan_inputs(sample.grid, kRadiusM, sample.start, sample.goal);
    return data;
  };
  plan.reference = [](const Data& data) {
    const auto passable =
        passable_cells(grid_of(data.inputs[0]), checked_radius(data.inputs[1].as<double>()[0]));
    auto outputs = make_tensors(specs()[0].outputs);
    put_path(plan_plainly(PlainSearch::kDijkstra, kMapWidth, kMapHeight, passable,
                          cell_of(data.inputs[2]), cell_of(data.inputs[3])),
             outputs);
    return outputs;
  };
  plan.verify = verify_path;
  plan.judge = judge_paths;

  Workload& avoiding = all[1];
  auto avoidance = std::make_shared<HostFunction>();
  avoidance->prepare = [](std::span<const Tensor>) -> KernelFunction { return avoid; };
  avoiding.operation = std::move(avoidance);
  avoiding.make_data = [](const DataRequest& request) {
    const AvoidSample sample = avoid_sample(request.seed, request.frame);
    Data data;
    data.inputs = avoid_inputs(sample.robot, sample.window, sample.moving, sample.target);
    return data;
  };
  avoiding.reference = [](const Data& data) {
    auto outputs = make_tensors(specs()[1].outputs);
    avoid(data.inputs, outputs);
    return outputs;
  };
  avoiding.verify = verify_close(1e-9);
  avoiding.judge = judge_commands;
  return all;
}

}  // namespace pirt::planning
