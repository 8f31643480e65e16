#include "workloads/base/geometry/camera.h"

#include <Eigen/LU>

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
  const double radial = 1.0 + r2 * (c.k1 + r2 * c.k2);
  const double slope = 2.0 * (c.k1 + 2.0 * r2 * c.k2);  // of radial, by r2, times 2
  Distorted d;
  d.point = {x * radial + 2.0 * c.p1 * x * y + c.p2 * (r2 + 2.0 * x * x),
             y * radial + c.p1 * (r2 + 2.0 * y * y) + 2.0 * c.p2 * x * y};
  const double mixed = x * y * slope + 2.0 * c.p1 * x + 2.0 * c.p2 * y;
  d.derivative << radial + x * x * slope + 2.0 * c.p1 * y + 6.0 * c.p2 * x, mixed, mixed,
      radial + y * y * slope + 6.0 * c.p1 * y + 2.0 * c.p2 * x;
  return d;
}

}  // namespace

Eigen::Vector2d CameraModel::project(const Eigen::Vector2d& ray) const {
  const Eigen::Vector2d d = distort(*this, ray).point;
  return {fx * d.x() + cx, fy * d.y() + cy};
}

Eigen::Vector2d CameraModel::ray(const Eigen::Vector2d& pixel) const {
  Eigen::Vector2d wanted((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
  if (k1 == 0.0 && k2 == 0.0 && p1 == 0.0 && p2 == 0.0) return wanted;
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
