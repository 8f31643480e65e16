// What the planning workloads are measured with: a generated map with queries, and moments of a
// robot among people.
#pragma once

#include <cstdint>
#include <vector>

#include "workloads/planning/avoid_obstacles.h"

namespace pirt::planning {

/// Eight rooms with doors, boxes in their corners and some unseen parts, in cells of 5 cm, and a
/// few obstacles that come and go: from one query to the next one appears and one is gone. Every
/// query has an answer for robots of up to 40 cm.
struct PlanSample {
  Grid grid;
  Cell start, goal;
};
[[nodiscard]] PlanSample plan_sample(std::uint64_t seed, int query);

/// A robot on its way through a room with boxes in which people walk, none nearer than 2 m to it,
/// so that it can still stop.
struct AvoidSample {
  Grid window;
  RobotState robot;
  std::vector<MovingObstacle> moving;
  Point target;
};
[[nodiscard]] AvoidSample avoid_sample(std::uint64_t seed, int moment);

}  // namespace pirt::planning
