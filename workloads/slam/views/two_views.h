// Two pictures of one camera: how it turned and where to it moved, from points that both show.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "workloads/base/geometry/geometry.h"

namespace pirt::slam {

/// What both pictures show of a point: its rays (x, y, 1) in the two camera frames.
struct RayPair {
  Eigen::Vector2d first, second;
};

/// The pose of the second camera in the frame of the first, at a distance of 1.
/// @param most_miss  Of an inlier from its epipolar line, radians near the axis.
/// @return  Absent if fewer than half of the points fit one motion and lie before both cameras.
/// @source  As turn_of, of two motions that fit as well with the smaller turn.
[[nodiscard]] std::optional<Pose> two_views(std::span<const RayPair> pairs, double most_miss);

/// Rotation from the first camera's frame to the second's (x_second = rotation * x_first).
struct Turn {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  /// Of d in: true rotation = rotation_of(d) * rotation. Radians^2.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double ray_sigma = 0;  ///< Of a point from its epipolar line, as it was found, in radians.
  std::size_t inliers = 0;
};

/// How the camera turned between two pictures that were taken soon after another: by less than a
/// quarter turn. Known also where it did not move; the points' depths are not needed.
/// @param most_miss  Of an inlier from its epipolar line, radians near the axis.
/// @param expected  Roughly: points of one plane fit two turns, of which the nearer is meant.
/// @return  Absent with fewer than 20 points that fit, or if they are fewer than half.
/// @source  Nister, An efficient solution to the five-point relative pose problem, PAMI 2004, in
/// RANSAC, which draws from a fixed seed of its own; from there, and from what is expected, least
/// squares of Sampson's distances with Cauchy's weights, whose scale is that of the residuals
/// (Hartley and Zisserman, Multiple view geometry, 2004, 11.4).
[[nodiscard]] std::optional<Turn> turn_of(std::span<const RayPair> pairs, double most_miss,
                                          const Eigen::Matrix3d& expected);

}  // namespace pirt::slam
