// Where the generated robot is at each moment: a smooth path whose derivatives are exact, so that
// what its IMU measures is exact, too.
//
// Position and heading are uniform B-splines of degree 5 (jerk is continuous). Their control points
// come from a rough plan, which the spline smooths; the spline is the truth, not the plan.
#pragma once

#include <cstdint>
#include <vector>

#include "workloads/base/geometry/geometry.h"

namespace pirt {

enum class PathShape : std::uint8_t {
  kLoop,   ///< Around the room, with changing radius, speed, height and view.
  kTurns,  ///< Straight, 90 degrees left, straight, 90 degrees left, straight.
  kRing,   ///< Around the corridor (room.h), 86 m a time at 1.5 m/s.
};

struct PathOptions {
  PathShape shape = PathShape::kLoop;
  double duration_s = 60.0;
  double rest_s = 2.0;  ///< At the start.
  std::uint64_t seed = 1;
};

struct BodyMotion {
  Pose body;  ///< body -> world; x forward, y left, z up.
  Eigen::Vector3d velocity_m_s;
  Eigen::Vector3d acceleration_m_s2;
  Eigen::Vector3d turn_rad_s;  ///< Of the body, in its own frame.
};

/// Immutable; any thread may ask.
class RobotPath {
 public:
  explicit RobotPath(const PathOptions& options);
  /// @param time_s  From 0 to the duration; a little beyond is good (exposures).
  [[nodiscard]] BodyMotion at(double time_s) const;

 private:
  void plan(const PathOptions& options, double swing);
  [[nodiscard]] double fastest_turn_rad_s(double duration_s) const;

  /// x, y, z, yaw, pitch, roll at each knot.
  using Control = Eigen::Matrix<double, 6, 1>;
  std::vector<Control> controls_;
};

}  // namespace pirt
