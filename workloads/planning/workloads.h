// Planning as workloads: what their tensors mean, and those tensors of a robot's own map.
#pragma once

#include <span>
#include <vector>

#include "workloads/model/workload.h"
#include "workloads/planning/avoid_obstacles.h"
#include "workloads/planning/plan_path.h"
#include "workloads/planning/specs.h"

namespace pirt::planning {

/// Kernel and workload have the same name; both are on the host only (host_function.h).
/// - "plan_path": a shortest path of a round robot. Inputs grid u8 [320,640] (CellState), radius
///   f64 [1] in cells, start and goal i32 [2] (column, row). Outputs status i32 [1] (PathStatus),
///   path i32 [<=204800,2] (column, row, from start to goal; no rows without a path) and length
///   f64 [1] in cells. A map is prepared when it first comes and when the radius is another than at
///   the call before; where cells are others, it is mended (changing_map.h). Measured with 8
///   queries on a generated map of 32 m x 16 m, in which with each of them an obstacle appears and
///   another goes. Verified: as long as what Dijkstra's algorithm finds, to 1e-6, and each move one
///   that the robot can make.
/// - "avoid_obstacles": the next command of a local planner, with AvoidOptions' defaults. Inputs
///   window u8 [160,160], place f64 [3] (x and y of its lower left corner, side of a cell, in m),
///   robot f64 [5] (x, y, heading, speed, turn rate), target f64 [2], moving f64 [<=32,5] (x, y,
///   velocity x and y, radius). Output command f64 [2] (m/s, rad/s). Measured with 8 moments
///   among people. Verified: as the function without tensors, within the limits, and safe: who
///   executes it and then brakes touches nothing, by an integration of its own in steps of 1 ms.
[[nodiscard]] std::vector<Workload> all();

/// plan_path's inputs for a map of one's own.
/// @param radius  Of the robot, in the grid's unit.
/// @throws Error{kBadInput} if the grid has more cells than there is room for.
[[nodiscard]] std::vector<Tensor> plan_inputs(const Grid& grid, double radius, Cell start,
                                              Cell goal);
/// Of its outputs.
[[nodiscard]] Path path_of(std::span<const Tensor> outputs);

/// avoid_obstacles' inputs. Of what moves the nearest kMostMoving are taken.
/// @param window  Of unit kMetres, with yaw 0: window_of().
/// @throws Error{kBadInput} for another one, and for one that is too large.
[[nodiscard]] std::vector<Tensor> avoid_inputs(const RobotState& robot, const Grid& window,
                                               std::span<const MovingObstacle> moving,
                                               Point target);
/// Of its output.
[[nodiscard]] VelocityCommand command_of(std::span<const Tensor> outputs);

}  // namespace pirt::planning
