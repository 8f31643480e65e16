#include "workloads/planning/verdicts.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <string>

#include "workloads/planning/workloads.h"

namespace pirt::planning {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLengthBound = 1e-6;

Verdict wrong(std::string detail) { return {false, kInfinity, std::move(detail)}; }

bool is_move(Cell from, Cell to) {
  return from != to && std::abs(to.x - from.x) <= 1 && std::abs(to.y - from.y) <= 1;
}

/// Why the robot cannot go it; empty if it can.
std::string obstacle_of(const Path& path, int width, std::span<const std::uint8_t> passable) {
  const auto free = [&](int x, int y) {
    const std::int64_t cell = std::int64_t{y} * width + x;
    return x >= 0 && y >= 0 && x < width && cell < std::ssize(passable) &&
           passable[static_cast<std::size_t>(cell)] != 0;
  };
  for (std::size_t i = 0; i < path.cells.size(); ++i) {
    const Cell at = path.cells[i];
    if (!free(at.x, at.y)) return fmt::format("cell {},{} is blocked", at.x, at.y);
    if (i == 0) continue;
    const Cell before = path.cells[i - 1];
    if (!free(at.x, before.y) || !free(before.x, at.y)) {
      return fmt::format("a corner is cut at {},{}", at.x, at.y);
    }
  }
  return "";
}

/// Small steps, unlike the planner's arcs.
constexpr double kStepS = 0.001;
void integrate(RobotState& robot) {
  robot.heading_rad += robot.turn_rate_rps * kStepS / 2;
  robot.position.x += robot.speed_mps * std::cos(robot.heading_rad) * kStepS;
  robot.position.y += robot.speed_mps * std::sin(robot.heading_rad) * kStepS;
  robot.heading_rad += robot.turn_rate_rps * kStepS / 2;
}

/// The centres of the window's cells that are not free.
std::vector<Point> obstacles_of(const Grid& window) {
  std::vector<Point> obstacles;
  for (int y = 0; y < window.height; ++y) {
    for (int x = 0; x < window.width; ++x) {
      if (window.at({x, y}) != CellState::kFree) obstacles.push_back(window.centre_of({x, y}));
    }
  }
  return obstacles;
}

/// The least room that is left, in metres: below 0 it touches something. People are wherever they
/// can be by then.
double least_room(const AvoidInputs& given, VelocityCommand command, const AvoidOptions& options) {
  const RobotLimits& limits = options.limits;
  const auto obstacles = obstacles_of(given.window);
  RobotState robot = given.robot;
  robot.speed_mps = command.speed_mps;
  robot.turn_rate_rps = command.turn_rate_rps;
  const auto slower = [](double value, double by) {
    return std::copysign(std::max(0.0, std::abs(value) - by), value);
  };
  double least = kInfinity;
  for (int step = 0; robot.speed_mps != 0 || robot.turn_rate_rps != 0; ++step) {
    const double seconds = step * kStepS;
    for (const MovingObstacle& other : given.moving) {
      least = std::min(least, distance(robot.position, other.position) - other.radius_m -
                                  options.people_speed_mps * seconds - limits.radius_m);
    }
    if (step % 20 == 0) {
      // The planner takes the robot to be in the centre of its cell.
      for (const Point obstacle : obstacles) {
        least = std::min(
            least, distance(robot.position, obstacle) - limits.radius_m + given.window.resolution);
      }
    }
    if (seconds >= options.period_s) {
      robot.speed_mps = slower(robot.speed_mps, limits.acceleration_mps2 * kStepS);
      robot.turn_rate_rps = slower(robot.turn_rate_rps, limits.turn_acceleration_rps2 * kStepS);
    }
    integrate(robot);
  }
  return least;
}

bool within_limits(const RobotState& robot, VelocityCommand command, const AvoidOptions& options) {
  const RobotLimits& limits = options.limits;
  const double gain = limits.acceleration_mps2 * options.period_s;
  const double turn_gain = limits.turn_acceleration_rps2 * options.period_s;
  constexpr double kRounding = 1e-9;
  // Who is beyond them already can come as near as it brakes.
  const double least = std::min(0.0, robot.speed_mps + gain);
  const double most = std::max(limits.most_speed_mps, robot.speed_mps - gain);
  const double most_turn =
      std::max(limits.most_turn_rate_rps, std::abs(robot.turn_rate_rps) - turn_gain);
  return command.speed_mps >= least - kRounding && command.speed_mps <= most + kRounding &&
         std::abs(command.turn_rate_rps) <= most_turn + kRounding &&
         std::abs(command.speed_mps - robot.speed_mps) <= gain + kRounding &&
         std::abs(command.turn_rate_rps - robot.turn_rate_rps) <= turn_gain + kRounding;
}

/// The first frame that is wrong, or the one that came closest to it, by @p judge of one.
template <typename Judge>
Verdict judge_each(std::span<const PlayedFrame> sequence, const Judge& judge) {
  Verdict closest{true, 0, "nothing to compare"};
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    Verdict verdict = judge(sequence[i]);
    verdict.detail = fmt::format("frame {} of {}: {}", i + 1, sequence.size(), verdict.detail);
    if (!verdict.ok) return verdict;
    if (i == 0 || verdict.worst_error > closest.worst_error) closest = std::move(verdict);
  }
  return closest;
}

}  // namespace

Verdict verify_path(std::span<const Tensor> outputs, std::span<const Tensor> expected) {
  if (outputs.size() != 3 || expected.size() != 3) return wrong("another number of outputs");
  const std::int32_t status = outputs[0].as<std::int32_t>()[0];
  const std::int32_t expected_status = expected[0].as<std::int32_t>()[0];
  if (status != expected_status) {
    return wrong(fmt::format("the status is {} where {} is expected", status, expected_status));
  }
  const Path got = path_of(outputs);
  const Path want = path_of(expected);
  const double error = std::abs(got.length - want.length);
  if (!(error <= kLengthBound)) {
    return {
        false, error,
        fmt::format("a length of {:.9g} cells where {:.9g} is expected", got.length, want.length)};
  }
  if (got.cells.size() != want.cells.size()) {
    return wrong(fmt::format("a path of {} cells where {} are expected", got.cells.size(),
                             want.cells.size()));
  }
  if (want.cells.empty()) return {true, error, "no path, as expected"};
  if (got.cells.front() != want.cells.front() || got.cells.back() != want.cells.back()) {
    return wrong("the path is one between other cells");
  }
  for (std::size_t i = 1; i < got.cells.size(); ++i) {
    if (is_move(got.cells[i - 1], got.cells[i])) continue;
    return wrong(fmt::format("cell {} of the path is no neighbour of the one before", i + 1));
  }
  if (std::abs(path_length(got.cells) - got.length) > kLengthBound) {
    return wrong("the path is not as long as it says");
  }
  return {true, error,
          fmt::format("{:.6g} cells long, off by {:.2g}, bound {:.2g}", got.length, error,
                      kLengthBound)};
}

Verdict judge_paths(std::span<const PlayedFrame> sequence) {
  return judge_each(sequence, [](const PlayedFrame& frame) {
    Verdict verdict = verify_path(frame.outputs, frame.expected);
    if (!verdict.ok) return verdict;
    const Tensor& grid = frame.data->inputs[0];
    const auto passable = passable_cells(grid_of(grid), frame.data->inputs[1].as<double>()[0]);
    const std::string obstacle =
        obstacle_of(path_of(frame.outputs), static_cast<int>(grid.dim(1)), passable);
    return obstacle.empty() ? verdict : wrong(obstacle);
  });
}

Verdict judge_commands(std::span<const PlayedFrame> sequence) {
  static const auto close = verify_close(1e-9);
  return judge_each(sequence, [](const PlayedFrame& frame) {
    Verdict verdict = close(frame.outputs, frame.expected);
    if (!verdict.ok) return verdict;
    const AvoidInputs given = avoid_inputs_of(frame.data->inputs);
    const VelocityCommand command = command_of(frame.outputs);
    if (!within_limits(given.robot, command, {})) return wrong("beyond the robot's limits");
    const double room = least_room(given, command, {});
    // What the integration's steps are off by.
    if (room < -1e-3) return wrong(fmt::format("{:.3f} m into an obstacle", -room));
    verdict.detail += fmt::format("; at least {:.2f} m of room until it stands", room);
    return verdict;
  });
}

}  // namespace pirt::planning
