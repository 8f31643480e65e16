#include "workloads/inputs/scene/path.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "workloads/base/math/random.h"
#include "workloads/inputs/scene/room.h"

namespace pirt {
namespace {

constexpr int kDegree = 5;
constexpr double kKnot_s = 0.1;
constexpr int kLead = 6;  ///< Knots before time 0 and after the end.
constexpr double kPi = std::numbers::pi;
constexpr double kFastestTurn_rad_s = 60.0 / kDegreesPerRadian;
const Eigen::Vector2d kCentre(4.0, 4.0);

/// Values of the degree + 1 uniform B-splines that are not 0 at @p u within [0, 1) of a knot span.
/// @source  de Boor, A practical guide to splines.
std::array<double, kDegree + 1> basis(int degree, double u) {
  std::array<double, kDegree + 1> b{1.0};
  for (int d = 1; d <= degree; ++d) {
    double carried = 0;
    for (int i = 0; i < d; ++i) {
      const double term = b[static_cast<std::size_t>(i)] / d;
      b[static_cast<std::size_t>(i)] = carried + (i + 1 - u) * term;
      carried = (u + d - 1 - i) * term;
    }
    b[static_cast<std::size_t>(d)] = carried;
  }
  return b;
}

double smooth_step(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * t * (t * (6 * t - 15) + 10);
}

struct Wave {
  double amplitude, rate, phase;
  [[nodiscard]] double at(double x) const { return amplitude * std::sin(rate * x + phase); }
};

Wave wave(Random& random, double amplitude, double slow, double fast) {
  return {amplitude, random.uniform(slow, fast), random.uniform(0, 2 * kPi)};
}

struct PlanarPose {
  Eigen::Vector2d point;
  double heading;
};

/// Around the centre; s in metres along the mean circle.
struct Loop {
  Wave wide, narrow;
  double start;
  [[nodiscard]] Eigen::Vector2d point(double s) const {
    constexpr double kRadius = 2.2;
    const double angle = start + s / kRadius;
    const double radius = kRadius + wide.at(s) + narrow.at(s);
    return kCentre + radius * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  }
  [[nodiscard]] Eigen::Vector2d slope(double s) const {
    constexpr double kStep = 1e-3;
    return (point(s + kStep) - point(s - kStep)) / (2 * kStep);
  }
  [[nodiscard]] PlanarPose at(double s) const {
    const Eigen::Vector2d d = slope(s);
    return {point(s), std::atan2(d.y(), d.x())};
  }
};

/// Three straights of 4.6 m and two quarter circles between them.
PlanarPose turns_at(double s) {
  constexpr double kRadius = 0.9;
  constexpr double kStraight = 3.7;
  constexpr double kArc = kRadius * kPi / 2;
  Eigen::Vector2d at(1.6, 1.7);
  double heading = 0;
  const auto forward = [&](double way) {
    at += way * Eigen::Vector2d(std::cos(heading), std::sin(heading));
  };
  for (int leg = 0;; ++leg) {
    const double straight = std::min(s, kStraight);
    forward(straight);
    s -= straight;
    if (s <= 0 || leg == 2) return {at, heading};
    const double arc = std::min(s, kArc);
    const double angle = arc / kRadius;
    const Eigen::Vector2d left(-std::sin(heading), std::cos(heading));
    const Eigen::Vector2d middle = at + kRadius * left;
    heading += angle;
    at = middle + kRadius * Eigen::Vector2d(std::sin(heading), -std::cos(heading));
    s -= arc;
    if (s <= 0) return {at, heading};
  }
}
constexpr double kTurnsLength_m = 3 * 3.7 + 0.9 * kPi;

constexpr double kRingSide_m = kCorridorSide_m - kCorridorWidth_m;
constexpr double kRingRadius_m = 2.0;
constexpr double kRingStraight_m = kRingSide_m - 2 * kRingRadius_m;
constexpr double kRingLength_m = 4 * kRingStraight_m + 2 * kPi * kRingRadius_m;

/// Along the middle of the corridor, @p aside to the left of it.
PlanarPose ring_at(double s, double aside) {
  s -= kRingLength_m * std::floor(s / kRingLength_m);
  constexpr double kQuarter = kRingLength_m / 4;
  const double side = std::floor(s / kQuarter);
  s -= side * kQuarter;
  // A straight along x, then a quarter circle.
  Eigen::Vector2d at(kRingRadius_m + std::min(s, kRingStraight_m), 0);
  double heading = 0;
  if (s > kRingStraight_m) {
    heading = (s - kRingStraight_m) / kRingRadius_m;
    at += kRingRadius_m * Eigen::Vector2d(std::sin(heading), 1 - std::cos(heading));
  }
  at += aside * Eigen::Vector2d(-std::sin(heading), std::cos(heading));
  const double turn = side * kPi / 2;
  const Eigen::Vector2d centre(kRingSide_m / 2, kRingSide_m / 2);
  const Eigen::Vector2d off = at - centre;
  const Eigen::Vector2d turned(std::cos(turn) * off.x() - std::sin(turn) * off.y(),
                               std::sin(turn) * off.x() + std::cos(turn) * off.y());
  const Eigen::Vector2d corner(kCorridorWidth_m / 2, kCorridorWidth_m / 2);
  return {corner + centre + turned, heading + turn};
}

double unwrapped(double angle, double near) {
  return angle + 2 * kPi * std::round((near - angle) / (2 * kPi));
}

}  // namespace

RobotPath::RobotPath(const PathOptions& options) {
  // Views that swing less where path and swing together would turn too fast.
  for (double swing = 1.0;; swing *= 0.8) {
    plan(options, swing);
    if (swing < 0.05 || fastest_turn_rad_s(options.duration_s) <= kFastestTurn_rad_s) return;
  }
}

void RobotPath::plan(const PathOptions& options, double swing) {
  Random random(derive_seed(options.seed, "path"));
  const bool loops = options.shape == PathShape::kLoop;
  const bool rings = options.shape == PathShape::kRing;
  const Loop loop{wave(random, 0.4, 0.3, 0.5), wave(random, 0.2, 0.6, 0.8),
                  random.uniform(0, 2 * kPi)};
  const Wave speed = wave(random, 0.35, 0.4, 0.7);
  const Wave up = wave(random, 0.18, 0.5, 0.8);
  const Wave yaw = wave(random, 0.45 * swing, 0.8, 1.2);
  const Wave pitch = wave(random, 0.08 * swing, 0.9, 1.6);
  const Wave roll = wave(random, 0.06 * swing, 0.9, 1.6);
  const Wave aside = wave(random, 0.2, 0.3, 0.5);  // last: the others are those of old seeds
  double mean_speed = loops ? 1.0 : 0.7;
  if (rings) mean_speed = 1.5;
  const int knots = static_cast<int>(std::ceil(options.duration_s / kKnot_s)) + 2 * kLead;
  constexpr int kFine = 50;  // steps of the integral a knot
  controls_.clear();
  double s = 0;
  double heading = 0;
  for (int k = 0; k < knots; ++k) {
    const double begin = (k - kLead) * kKnot_s;
    const PlanarPose place = loops ? loop.at(s) : rings ? ring_at(s, aside.at(s)) : turns_at(s);
    heading = k == 0 ? place.heading : unwrapped(place.heading, heading);
    const double moving = smooth_step((begin - options.rest_s) / 3.0);
    const double lively = loops || rings ? moving : 0.3 * moving;
    Control control;
    control << place.point, 1.4 + lively * up.at(begin), heading + lively * yaw.at(begin),
        lively * pitch.at(begin), lively * roll.at(begin);
    controls_.push_back(control);
    for (int i = 0; i < kFine; ++i) {
      const double t = begin + (i + 0.5) * kKnot_s / kFine;
      double v =
          (mean_speed + (loops ? speed.at(t) : 0.0)) * smooth_step((t - options.rest_s) / 1.5);
      if (loops) {
        v /= loop.slope(s).norm();
      } else if (!rings) {
        v *= smooth_step((kTurnsLength_m - s) / 0.7 + 0.02);
      }
      s += v * kKnot_s / kFine;
    }
  }
}

double RobotPath::fastest_turn_rad_s(double duration_s) const {
  double fastest = 0;
  for (double t = 0; t < duration_s; t += 0.02)
    fastest = std::max(fastest, at(t).turn_rad_s.norm());
  return fastest;
}

BodyMotion RobotPath::at(double time_s) const {
  // Control k is centred on the knot time (k - kLead) * kKnot_s.
  const double x = time_s / kKnot_s + kLead - 0.5 * (kDegree - 1) - 0.5;
  const double highest = static_cast<double>(controls_.size()) - kDegree - 1 - 1e-9;
  const double inside = std::clamp(x, 0.0, highest);
  const auto first = static_cast<std::size_t>(inside);
  const double u = inside - static_cast<double>(first);
  std::array<Control, kDegree + 1> c;
  std::copy_n(controls_.begin() + static_cast<std::ptrdiff_t>(first), kDegree + 1, c.begin());
  std::array<Control, 3> values;
  for (int order = 0; order < 3; ++order) {
    const auto b = basis(kDegree - order, u);
    Control sum = Control::Zero();
    for (int i = 0; i <= kDegree - order; ++i) {
      sum += b[static_cast<std::size_t>(i)] * c[static_cast<std::size_t>(i)];
    }
    values[static_cast<std::size_t>(order)] = sum;
    for (int i = 0; i < kDegree - order; ++i) {
      const auto k = static_cast<std::size_t>(i);
      c[k] = (c[k + 1] - c[k]) / kKnot_s;
    }
  }
  const auto& [value, rate, second] = values;
  const double yaw = value(3);
  const double pitch = value(4);
  const double roll = value(5);
  BodyMotion motion;
  motion.body.position = value.head<3>();
  motion.body.rotation = (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                          Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                          Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
                             .toRotationMatrix();
  motion.velocity_m_s = rate.head<3>();
  motion.acceleration_m_s2 = second.head<3>();
  const double dy = rate(3);
  const double dp = rate(4);
  const double dr = rate(5);
  motion.turn_rad_s = {dr - dy * std::sin(pitch),
                       dp * std::cos(roll) + dy * std::sin(roll) * std::cos(pitch),
                       -dp * std::sin(roll) + dy * std::cos(roll) * std::cos(pitch)};
  return motion;
}

}  // namespace pirt
