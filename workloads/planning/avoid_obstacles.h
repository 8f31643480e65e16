// The local planner: the next velocity of a robot among people, towards a target.
//
// Looks at a window of the map around the robot and at what moves there. It plans no way round
// large obstacles: its target is a point ahead on the path of plan_path (path_follower.h).
#pragma once

#include <span>
#include <vector>

#include "workloads/planning/grid.h"

namespace pirt::planning {

/// A round robot with differential drive; angles counter-clockwise from the x axis.
struct RobotState {
  Point position;
  double heading_rad = 0;
  double speed_mps = 0;  ///< Forwards.
  double turn_rate_rps = 0;
};

struct VelocityCommand {
  double speed_mps = 0;
  double turn_rate_rps = 0;
};

/// A disc that moves, e.g. a person that is tracked.
struct MovingObstacle {
  Point position;
  Point velocity;  ///< m/s
  double radius_m = 0;
};

struct RobotLimits {
  double radius_m = 0.25;
  double most_speed_mps = 1;
  double most_turn_rate_rps = 1.5;
  double acceleration_mps2 = 1.5;  ///< Braking too.
  double turn_acceleration_rps2 = 6;
};

struct AvoidOptions {
  RobotLimits limits = {};
  double period_s = 0.1;  ///< From command to command.
  double horizon_s = 2;   ///< How far ahead commands are compared.
  /// How fast whatever moves may become at once, in any direction.
  double people_speed_mps = 1;
};

/// The part of @p map in a square of @p side_m around @p centre; what lies outside the map is
/// unknown.
/// @param map  Of unit kMetres, with yaw 0.
/// @throws Error{kBadInput} for another one.
[[nodiscard]] Grid window_of(const Grid& map, Point centre, double side_m);

/// The command of the next period: within the limits of speed and acceleration from the robot's
/// present velocity, and towards @p target. A robot that rolls backwards or is beyond its limits
/// brakes.
///
/// It is *passively safe*: if the robot executes it for a period and then brakes as hard as it can,
/// it comes to a stand before it touches anything: cells of the window that are not free (by the
/// distance of centres, as passable_cells), and moving obstacles wherever they may be by then at
/// people_speed_mps. Braking remains safe from one call to the next, so that the robot touches
/// nothing while it moves, and no command is safe that it would need more than a minute to stand
/// from; what walks into a robot that stands it cannot avoid. Among safe commands
/// that one wins which comes closest to the target within the horizon, with room to where people
/// will be if they walk on as they do.
/// @param window  Of unit kMetres; what lies outside it cannot be entered.
/// @source  Fox, Burgard, Thrun: The Dynamic Window Approach to Collision Avoidance, 1997; Macek et
/// al.: Towards Safe Vehicle Navigation in Dynamic Urban Scenarios, 2009 (passive safety).
[[nodiscard]] VelocityCommand avoid_obstacles(const RobotState& robot, const Grid& window,
                                              std::span<const MovingObstacle> moving, Point target,
                                              const AvoidOptions& options);

}  // namespace pirt::planning
