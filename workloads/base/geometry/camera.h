// A pinhole camera with a lens, as calibrations describe one.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "workloads/base/geometry/geometry.h"

namespace pirt {

enum class Lens : std::uint8_t {
  kRadialTangential,  ///< OpenCV's (k1, k2, p1, p2, k3, k4, k5, k6): plumb_bob, rational.
  kEquidistant,       ///< OpenCV's fisheye (k1, k2, k3, k4).
};

/// Coefficients of the lens that are all 0 are those of a picture that is rectified already; of an
/// equidistant one they are not.
struct CameraModel {
  int width = 0, height = 0;  ///< Pixels.
  double fx = 0, fy = 0, cx = 0, cy = 0;
  Lens lens = Lens::kRadialTangential;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0, k4 = 0, k5 = 0, k6 = 0;
  Pose body_from_camera;
  double rate_hz = 0;

  /// Where the ray (x, y, 1) of the camera's frame falls, in pixels.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector2d& ray) const;
  /// The ray of a pixel: the inverse of project(), to 1e-9 where the lens is invertible.
  /// @source  Fixed-point start and Newton steps on the distortion polynomial.
  [[nodiscard]] Eigen::Vector2d ray(const Eigen::Vector2d& pixel) const;
  [[nodiscard]] bool contains(const Eigen::Vector2d& pixel, double border = 0.0) const {
    return pixel.x() >= border && pixel.y() >= border && pixel.x() <= width - 1 - border &&
           pixel.y() <= height - 1 - border;
  }
  /// Between its two farthest edges; without the corners.
  [[nodiscard]] double widest_view_deg() const;
  /// One figure for both axes: what turns an angle into pixels near the centre.
  [[nodiscard]] double focal() const { return 0.5 * (fx + fy); }
};

}  // namespace pirt
