#include "workloads/base/geometry/camera.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace pirt {
namespace {

struct Distorted {
  Eigen::Vector2d point;
  Eigen::Matrix2d derivative;
};

Distorted distort(const CameraModel& c, const Eigen::Vector2d& ray) {
  const double x = ray.x();
  const double y = ray.y();
  const double r2 = x * x + y * y;
  const double above = 1.0 + r2 * (c.k1 + r2 * (c.k2 + r2 * c.k3));
  const double below = 1.0 + r2 * (c.k4 + r2 * (c.k5 + r2 * c.k6));
  const double radial = above / below;
  const double above_slope = c.k1 + r2 * (2.0 * c.k2 + 3.0 * r2 * c.k3);
  const double below_slope = c.k4 + r2 * (2.0 * c.k5 + 3.0 * r2 * c.k6);
  // Of radial, by r2, times 2.
  const double slope = 2.0 * (above_slope - radial * below_slope) / below;
  Distorted d;
  d.point = {x * radial + 2.0 * c.p1 * x * y + c.p2 * (r2 + 2.0 * x * x),
             y * radial + c.p1 * (r2 + 2.0 * y * y) + 2.0 * c.p2 * x * y};
  const double mixed = x * y * slope + 2.0 * c.p1 * x + 2.0 * c.p2 * y;
  d.derivative << radial + x * x * slope + 2.0 * c.p1 * y + 6.0 * c.p2 * x, mixed, mixed,
      radial + y * y * slope + 6.0 * c.p1 * y + 2.0 * c.p2 * x;
  return d;
}

/// How far from the centre, over the focal length, an equidistant lens shows what comes at an
/// angle.
double radius_at(const CameraModel& c, double angle) {
  const double a2 = angle * angle;
  return angle * (1.0 + a2 * (c.k1 + a2 * (c.k2 + a2 * (c.k3 + a2 * c.k4))));
}

/// Its inverse.
double angle_at(const CameraModel& c, double radius) {
  constexpr double kWidest = 1.5;  // a ray (x, y, 1) has less than a quarter turn
  double low = 0;
  double high = kWidest;
  constexpr int kHalvings = 52;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (radius_at(c, middle) < radius ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

double CameraModel::widest_view_deg() const {
  const auto half = [this](double x, double y) {
    return std::atan(ray({x, y}).norm()) * kDegreesPerRadian;
  };
  return std::max(half(0, cy) + half(width - 1, cy), half(cx, 0) + half(cx, height - 1));
}

Eigen::Vector2d CameraModel::project(const Eigen::Vector2d& ray) const {
  if (lens == Lens::kEquidistant) {
    const double radius = ray.norm();
    const double scale = radius < 1e-9 ? 1.0 : radius_at(*this, std::atan(radius)) / radius;
    return {fx * scale * ray.x() + cx, fy * scale * ray.y() + cy};
  }
  const Eigen::Vector2d d = distort(*this, ray).point;
  return {fx * d.x() + cx, fy * d.y() + cy};
}

Eigen::Vector2d CameraModel::ray(const Eigen::Vector2d& pixel) const {
  Eigen::Vector2d wanted((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
  if (lens == Lens::kEquidistant) {
    const double radius = wanted.norm();
    return radius < 1e-9 ? wanted
                         : Eigen::Vector2d(wanted * std::tan(angle_at(*this, radius)) / radius);
  }
  if (std::ranges::all_of(std::array{k1, k2, p1, p2, k3, k4, k5, k6},
                          [](double each) { return each == 0.0; })) {
    return wanted;
  }
  constexpr int kSteps = 8;
  constexpr double kEnough = 1e-20;
  Eigen::Vector2d guess = wanted;
  for (int step = 0; step < kSteps; ++step) {
    const Distorted d = distort(*this, guess);
    const Eigen::Vector2d miss = wanted - d.point;
    if (miss.squaredNorm() < kEnough) break;
    guess += d.derivative.inverse() * miss;
  }
  return guess;
}

}  // namespace pirt
