// A camera's pose from points and their rays, robustly: OpenCV's P3P in RANSAC, which draws from a
// fixed seed of its own, then least squares over what fits.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "workloads/base/geometry/geometry.h"

namespace pirt::slam {

struct PointMatch {
  Eigen::Vector3d point;  ///< World.
  Eigen::Vector2d ray;    ///< (x, y, 1) of the camera.
};

struct PnpResult {
  Pose camera;  ///< camera -> world
  std::vector<std::size_t> inliers;
};

/// @param most_miss  Of an inlier's ray, radians near the axis.
/// @return  Absent with fewer than 6 matches or 6 inliers. Points on one plane are as good as
/// others.
/// @source  Ke and Roumeliotis, An efficient algebraic solution to the perspective-three-point
/// problem, CVPR 2017; Terzakis and Lourakis, A consistently fast and globally optimal solution to
/// the perspective-n-point problem, ECCV 2020 (where the least squares start).
[[nodiscard]] std::optional<PnpResult> robust_pnp(std::span<const PointMatch> matches,
                                                  double most_miss);

}  // namespace pirt::slam
