// What right answers of the planning workloads are, by means of their own.
#pragma once

#include <span>
#include <vector>

#include "workloads/model/workload.h"
#include "workloads/planning/avoid_obstacles.h"

namespace pirt::planning {

/// A grid's cells, in unit kCells. @throws Error{kBadInput} for what is no CellState.
[[nodiscard]] Grid grid_of(const Tensor& tensor);
/// @throws Error{kBadInput} for what is no radius.
[[nodiscard]] double checked_radius(double radius);

/// avoid_obstacles' inputs. @throws Error{kBadInput} for cells or a side of theirs that cannot be.
struct AvoidInputs {
  Grid window;
  RobotState robot;
  Point target;
  std::vector<MovingObstacle> moving;
};
[[nodiscard]] AvoidInputs avoid_inputs_of(std::span<const Tensor> inputs);

/// plan_path: the status, and a path of neighbours between the same ends that is as long as both
/// say.
[[nodiscard]] Verdict verify_path(std::span<const Tensor> outputs,
                                  std::span<const Tensor> expected);
/// Besides, that the robot can go it: all its cells are passable, and no corner is cut.
[[nodiscard]] Verdict judge_paths(std::span<const PlayedFrame> sequence);

/// avoid_obstacles: as the function without tensors, within the limits, and safe.
[[nodiscard]] Verdict judge_commands(std::span<const PlayedFrame> sequence);

}  // namespace pirt::planning
