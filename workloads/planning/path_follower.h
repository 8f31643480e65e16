// Following a path: which point of it a robot heads for.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "workloads/planning/grid.h"

namespace pirt::planning {

/// Keeps how far along its path a robot has come. The point of a path nearest to the robot may lie
/// behind a thin wall that the path goes round; where the robot can be by now lies a little further
/// along.
class PathFollower {
 public:
  PathFollower() = default;
  /// @param path  Its cells' centres, from where the robot is; empty = there is none.
  explicit PathFollower(std::vector<Point> path) : path_(std::move(path)) {}

  [[nodiscard]] bool empty() const { return path_.empty(); }
  /// The point that lies @p ahead_m along the path beyond where the robot is on it, or the path's
  /// end if that is nearer. Where it is: nearest to @p position of what lies, from where it was, no
  /// further along the path than @p ahead_m and as much as it has moved since the last call.
  /// The path is not empty.
  [[nodiscard]] Point ahead(Point position, double ahead_m);

 private:
  std::vector<Point> path_;
  std::size_t at_ = 0;
  Point before_;
  bool asked_ = false;
};

}  // namespace pirt::planning
