#include "workloads/planning/avoid_obstacles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "workloads/base/error.h"

namespace pirt::planning {
namespace {

constexpr int kSpeeds = 7;
constexpr int kTurnRates = 15;
constexpr double kLookS = 0.2;    ///< Between the places compared within the horizon,
constexpr double kBrakeS = 0.05;  ///< and those checked until the robot stands.
/// Who needs longer to stand is going to touch something, or was measured wrongly.
constexpr double kLongestBrakeS = 60;
/// Room beyond touching that is worth having, and what lacking all of it costs, in metres of way.
constexpr double kRoomM = 0.5;
constexpr double kRoomWorthM = 0.6;
/// What a contact costs that comes if everybody goes on, at once or at the end of the horizon.
constexpr double kContactWorthM = 3;
/// Facing the target is worth so many metres a radian: what a robot that has to turn first gains.
constexpr double kFacingWorthM = 0.1;

/// Not std::hypot: nothing here overflows, and it takes ten times as long.
double quick_distance(Point a, Point b) {
  return std::sqrt((a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y));
}

/// Distance to what is not free in a window, by the cell that a point lies in.
class StaticRoom {
 public:
  explicit StaticRoom(const Grid& window) : window_(window), squared_(squared_distances(window)) {}

  [[nodiscard]] double at(Point point) const {
    const Cell cell = window_.cell_of(point);
    if (!window_.contains(cell)) return 0;
    return std::sqrt(static_cast<double>(squared_[window_.index(cell)])) * window_.resolution;
  }

 private:
  const Grid& window_;
  std::vector<std::int64_t> squared_;
};

/// Along the arc of constant speed and turn rate.
RobotState moved(RobotState robot, double seconds) {
  const double turned = robot.turn_rate_rps * seconds;
  const double middle = robot.heading_rad + turned / 2;
  const double half = turned / 2;
  const double chord =
      robot.speed_mps * seconds * (std::abs(half) < 1e-9 ? 1 : std::sin(half) / half);
  robot.position.x += chord * std::cos(middle);
  robot.position.y += chord * std::sin(middle);
  robot.heading_rad += turned;
  return robot;
}

double towards(double value, double goal, double most) {
  return std::clamp(goal, value - most, value + most);
}

class Choice {
 public:
  Choice(const RobotState& robot, const Grid& window, std::span<const MovingObstacle> moving,
         Point target, const AvoidOptions& options)
      : robot_(robot), room_(window), moving_(moving), target_(target), options_(options) {
    // Who starts nearer than the radius to a wall may leave, and not come nearer.
    least_room_m_ = std::min(options.limits.radius_m, room_.at(robot.position));
  }

  [[nodiscard]] VelocityCommand best() const {
    const RobotLimits& limits = options_.limits;
    const double gain = limits.acceleration_mps2 * options_.period_s;
    const double turn_gain = limits.turn_acceleration_rps2 * options_.period_s;
    // Braking, which was safe when the command before was chosen.
    VelocityCommand best{towards(robot_.speed_mps, 0, gain),
                         towards(robot_.turn_rate_rps, 0, turn_gain)};
    double best_worth = -std::numeric_limits<double>::infinity();
    const auto consider = [&](VelocityCommand command) {
      if (!is_safe(command)) return;
      const double worth = worth_of(command);
      if (worth > best_worth) best = command, best_worth = worth;
    };
    consider(best);
    const double low = std::max(0.0, robot_.speed_mps - gain);
    const double high = std::min(limits.most_speed_mps, robot_.speed_mps + gain);
    const double most_turn = limits.most_turn_rate_rps;
    // The rate comes first: what is no number stays none.
    const double left = std::min(robot_.turn_rate_rps + turn_gain, most_turn);
    const double right = std::max(robot_.turn_rate_rps - turn_gain, -most_turn);
    if (low > high || right > left) return best;  // Beyond its limits it brakes.
    for (int i = 0; i < kSpeeds; ++i) {
      for (int k = 0; k < kTurnRates; ++k) {
        consider({std::lerp(low, high, i / (kSpeeds - 1.0)),
                  std::lerp(right, left, k / (kTurnRates - 1.0))});
      }
    }
    return best;
  }

 private:
  [[nodiscard]] RobotState with(VelocityCommand command) const {
    RobotState robot = robot_;
    robot.speed_mps = command.speed_mps;
    robot.turn_rate_rps = command.turn_rate_rps;
    return robot;
  }

  /// Whether nothing can be touched there by who has moved @p reach_m since now.
  [[nodiscard]] bool is_clear(const RobotState& robot, double reach_m) const {
    if (room_.at(robot.position) < least_room_m_) return false;
    return std::ranges::all_of(moving_, [&](const MovingObstacle& other) {
      return quick_distance(robot.position, other.position) >=
             options_.limits.radius_m + other.radius_m + reach_m;
    });
  }

  /// One period as commanded, then braking until the robot stands. What is clear at the end of a
  /// step was so within it, where the robot was up to its way back and people had less time; a
  /// robot faster than people needs the difference as room.
  [[nodiscard]] bool is_safe(VelocityCommand command) const {
    const RobotLimits& limits = options_.limits;
    RobotState robot = with(command);
    const double stands_s = std::max(std::abs(robot.speed_mps) / limits.acceleration_mps2,
                                     std::abs(robot.turn_rate_rps) / limits.turn_acceleration_rps2);
    if (!(stands_s <= kLongestBrakeS)) return false;  // Nor what is no number.
    double seconds = 0;
    while (robot.speed_mps != 0 || robot.turn_rate_rps != 0) {
      const bool braking = seconds >= options_.period_s - 1e-9;
      const double step = braking ? kBrakeS : std::min(kBrakeS, options_.period_s - seconds);
      const double faster_mps =
          std::max(0.0, std::abs(robot.speed_mps) - options_.people_speed_mps);
      if (braking) {
        robot.speed_mps = towards(robot.speed_mps, 0, limits.acceleration_mps2 * step);
        robot.turn_rate_rps = towards(robot.turn_rate_rps, 0, limits.turn_acceleration_rps2 * step);
      }
      robot = moved(robot, step);
      seconds += step;
      if (!is_clear(robot, options_.people_speed_mps * seconds + faster_mps * step)) return false;
    }
    return true;
  }

  [[nodiscard]] double worth_of(VelocityCommand command) const {
    RobotState robot = with(command);
    double worth = 0;
    double least_room = kRoomM;
    double nearest = quick_distance(robot.position, target_);
    const double before = nearest;
    for (double seconds = kLookS; seconds <= options_.horizon_s + 1e-9; seconds += kLookS) {
      robot = moved(robot, kLookS);
      nearest = std::min(nearest, quick_distance(robot.position, target_));
      const double room = room_at(robot, seconds);
      if (room < 0) {
        worth -= kContactWorthM * (1 - seconds / (options_.horizon_s + kLookS));
        least_room = 0;
        break;
      }
      least_room = std::min(least_room, room);
    }
    const double bearing = std::atan2(target_.y - robot.position.y, target_.x - robot.position.x);
    const double off = std::remainder(bearing - robot.heading_rad, 2 * std::numbers::pi);
    return worth + (before - nearest) - kRoomWorthM * (1 - least_room / kRoomM) -
           kFacingWorthM * std::abs(off);
  }

  /// To walls, and to where people will be if they walk on.
  [[nodiscard]] double room_at(const RobotState& robot, double seconds) const {
    double room = room_.at(robot.position) - least_room_m_;
    for (const auto& other : moving_) {
      const Point then{other.position.x + seconds * other.velocity.x,
                       other.position.y + seconds * other.velocity.y};
      room = std::min(
          room, quick_distance(robot.position, then) - options_.limits.radius_m - other.radius_m);
    }
    return room;
  }

  const RobotState& robot_;
  StaticRoom room_;
  std::span<const MovingObstacle> moving_;
  Point target_;
  const AvoidOptions& options_;
  double least_room_m_ = 0;
};

}  // namespace

Grid window_of(const Grid& map, Point centre, double side_m) {
  if (map.unit != Unit::kMetres || map.yaw_rad != 0) {
    throw_bad_input("a window is cut from a map in metres that is not turned (yaw 0)");
  }
  Grid window;
  window.unit = map.unit;
  window.resolution = map.resolution;
  const int side = std::max(1, static_cast<int>(std::lround(side_m / map.resolution)));
  window.width = window.height = side;
  const Cell middle = map.cell_of(centre);
  const Cell first{middle.x - side / 2, middle.y - side / 2};
  window.origin = {map.origin.x + first.x * map.resolution,
                   map.origin.y + (map.height - first.y - side) * map.resolution};
  window.cells.reserve(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const Cell cell{first.x + x, first.y + y};
      window.cells.push_back(map.contains(cell) ? map.at(cell) : CellState::kUnknown);
    }
  }
  return window;
}

VelocityCommand avoid_obstacles(const RobotState& robot, const Grid& window,
                                std::span<const MovingObstacle> moving, Point target,
                                const AvoidOptions& options) {
  return Choice(robot, window, moving, target, options).best();
}

}  // namespace pirt::planning
