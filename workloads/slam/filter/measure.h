// What a camera measures of a point: projection, its derivatives, and the point from its views.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "workloads/slam/filter/filter.h"

namespace pirt::slam {

/// A point in a picture: the camera's pose (camera -> world) and the ray (x, y, 1) in its frame.
struct View {
  Pose camera;
  Eigen::Vector2d ray;
};

struct Triangulated {
  Eigen::Vector3d point;      ///< World.
  double depth = 0;           ///< Along the axis of the first view.
  double relative_sigma = 0;  ///< Of the depth, for rays that are off by @p ray_sigma.
  double rms = 0;             ///< Of the rays, same unit as ray_sigma.
};

/// The point that is nearest to its rays, in least squares of the rays.
/// @param ray_sigma  Of each ray's coordinate, radians near the axis.
/// @return  Absent if it lies behind a camera or cannot be found. Points too far to have a depth
///          come out at kFarthest times the base line.
/// @source  Mourikis and Roumeliotis, 2007, appendix: inverse depth in the first view, Levenberg's
/// damping.
[[nodiscard]] std::optional<Triangulated> triangulate(std::span<const View> views,
                                                      double ray_sigma);

/// Depth along the left axis from one pair of rays; absent if they do not meet within
/// @p most_miss (of the right ray, radians).
[[nodiscard]] std::optional<double> stereo_depth(const Setup& setup, const Eigen::Vector2d& left,
                                                 const Eigen::Vector2d& right, double most_miss);
/// Up to where stereo_depth() tells a depth, and not only that a point is far; 0 of one camera.
[[nodiscard]] double farthest_stereo(const Setup& setup);

/// A ray beside a point that it may be of, in the ray's unit.
struct RayRows {
  Eigen::Vector2d miss;
  Eigen::Matrix<double, 2, 3> slope;  ///< d ray / d point, world axes.
};
[[nodiscard]] RayRows rows_of_ray(const Pose& camera, const Eigen::Vector3d& point,
                                  const Eigen::Vector2d& ray);

/// How well rays tell a point.
struct PointFit {
  double rms = 0;  ///< Of the rays.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};
/// @return  Absent if they do not tell its place.
[[nodiscard]] std::optional<PointFit> fit_of(std::span<const View> views,
                                             const Eigen::Vector3d& point, double ray_sigma);

/// All that a track's clones saw of it, as rows in pixels: of clones' errors and, in to_point, of
/// the point's own error (world axes).
struct PointRows {
  RowBlock rows;
  Eigen::MatrixXd to_point;
};
[[nodiscard]] PointRows rows_of_track(const State& state, const Setup& setup, const Track& track,
                                      const Eigen::Vector3d& point);

/// compressed(), of blocks of the clones that tracks are seen from.
[[nodiscard]] RowBlock compressed_window(const State& state, const std::vector<RowBlock>& blocks);

/// One observation of a landmark from the newest clone, in pixels.
[[nodiscard]] RowBlock rows_of_landmark(const State& state, const Setup& setup,
                                        std::size_t landmark, const Observation& seen,
                                        double sigma);

/// How far off the first pixel of a block may be expected, by the state's covariance alone: the
/// larger of both axes, in pixels.
[[nodiscard]] double predicted_sigma(const State& state, const RowBlock& block);

/// The views of a track, left and right.
[[nodiscard]] std::vector<View> views_of(const State& state, const Setup& setup,
                                         const Track& track);

/// Where a point of the world falls in a camera, in pixels; absent if behind it or far outside.
[[nodiscard]] std::optional<Eigen::Vector2d> pixel_of(const CameraModel& camera, const Pose& pose,
                                                      const Eigen::Vector3d& point);

}  // namespace pirt::slam
