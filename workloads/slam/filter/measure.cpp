#include "workloads/slam/filter/measure.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace pirt::slam {
namespace {

constexpr double kNearest = 0.05;    // of a point's depth, metres
constexpr double kFarthest = 400.0;  // of a depth, in base lines

using Projection = Eigen::Matrix<double, 2, 3>;

Projection projection_slope(const Eigen::Vector3d& p) {
  const double w = 1.0 / p.z();
  Projection j;
  j << w, 0, -p.x() * w * w, 0, w, -p.y() * w * w;
  return j;
}

const Clone& clone_of(const State& state, std::int64_t frame) {
  return *std::ranges::find(state.clones, frame, &Clone::frame);
}

/// The nearest point to all lines, by normal equations.
Eigen::Vector3d linear_point(std::span<const View> views) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const auto& view : views) {
    const Eigen::Vector3d along = (view.camera.rotation * view.ray.homogeneous()).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - along * along.transpose();
    a += across;
    b += across * view.camera.position;
  }
  return a.ldlt().solve(b);
}

struct Fit {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double cost = 0;
  bool behind = false;
};

/// @param q  (x/z, y/z, 1/z) in the first view.
Fit fit_at(std::span<const Pose> from_first, std::span<const View> views,
           const Eigen::Vector3d& q) {
  Fit fit;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Pose& pose = from_first[i];
    const Eigen::Vector3d p =
        pose.rotation * Eigen::Vector3d(q.x(), q.y(), 1.0) + q.z() * pose.position;
    if (p.z() <= 1e-3) {
      fit.behind = true;
      return fit;
    }
    const Eigen::Vector2d miss = views[i].ray - p.head<2>() / p.z();
    Eigen::Matrix3d slope;
    slope << pose.rotation.col(0), pose.rotation.col(1), pose.position;
    const Projection j = projection_slope(p) * slope;
    fit.normal += j.transpose() * j;
    fit.gradient += j.transpose() * miss;
    fit.cost += miss.squaredNorm();
  }
  return fit;
}

struct Row {
  Eigen::Vector2d residual;
  Projection to_point;  ///< d ray / d point, world axes.
  bool good = false;
};

Row row_of(const CameraModel& camera, const Pose& body, const Eigen::Vector2d& ray,
           const Eigen::Vector3d& point) {
  const Pose pose = body * camera.body_from_camera;
  const Eigen::Vector3d p = pose.rotation.transpose() * (point - pose.position);
  Row row;
  row.good = p.z() > kNearest;
  if (!row.good) return row;
  row.residual = camera.focal() * (ray - p.head<2>() / p.z());
  row.to_point = camera.focal() * projection_slope(p) * pose.rotation.transpose();
  return row;
}

}  // namespace

std::optional<Triangulated> triangulate(std::span<const View> views, double ray_sigma) {
  if (views.size() < 2) return std::nullopt;
  std::vector<Pose> from_first;
  double base = 0;
  for (const auto& view : views) {
    from_first.push_back(view.camera.inverse() * views.front().camera);
    base = std::max(base, (view.camera.position - views.front().camera.position).norm());
  }
  if (base < 1e-6) return std::nullopt;
  const Eigen::Vector3d start = views.front().camera.inverse() * linear_point(views);
  const double least_inverse = 1.0 / (kFarthest * base);
  Eigen::Vector3d q(views.front().ray.x(), views.front().ray.y(), least_inverse);
  if (start.z() > kNearest && start.z() * least_inverse < 1) {
    q = {start.x() / start.z(), start.y() / start.z(), 1.0 / start.z()};
  }
  Fit fit = fit_at(from_first, views, q);
  if (fit.behind) {
    q = {views.front().ray.x(), views.front().ray.y(), least_inverse};
    fit = fit_at(from_first, views, q);
    if (fit.behind) return std::nullopt;
  }
  double damping = 1e-3;
  constexpr int kSteps = 10;
  for (int step = 0; step < kSteps; ++step) {
    Eigen::Matrix3d damped = fit.normal;
    damped.diagonal() *= 1.0 + damping;
    const Eigen::Vector3d move = damped.ldlt().solve(fit.gradient);
    Eigen::Vector3d next = q + move;
    next.z() = std::max(next.z(), least_inverse);
    const Fit there = fit_at(from_first, views, next);
    if (there.behind || there.cost >= fit.cost) {
      damping *= 10;
      if (damping > 1e3) break;
      continue;
    }
    const double gain = fit.cost - there.cost;
    q = next;
    fit = there;
    damping = std::max(damping / 10, 1e-6);
    if (gain < 1e-3 * ray_sigma * ray_sigma) break;
  }
  Triangulated t;
  t.depth = 1.0 / q.z();
  if (!(t.depth > kNearest)) return std::nullopt;
  t.point = views.front().camera * Eigen::Vector3d(q.x() * t.depth, q.y() * t.depth, t.depth);
  t.rms = std::sqrt(fit.cost / (2.0 * static_cast<double>(views.size())));
  const double variance = fit.normal.inverse()(2, 2);
  t.relative_sigma = variance > 0 ? ray_sigma * std::sqrt(variance) / q.z() : 1e9;
  return t;
}

std::optional<double> stereo_depth(const Setup& setup, const Eigen::Vector2d& left,
                                   const Eigen::Vector2d& right, double most_miss) {
  const Pose right_from_left =
      setup.cameras[1].body_from_camera.inverse() * setup.cameras[0].body_from_camera;
  // right ~ R left + t / depth: least squares for the inverse depth, both coordinates.
  const Eigen::Vector3d a = right_from_left.rotation * left.homogeneous();
  const Eigen::Vector3d& t = right_from_left.position;
  const Eigen::Vector2d slope = t.head<2>() - right * t.z();
  const Eigen::Vector2d miss = right * a.z() - a.head<2>();
  const double inverse = slope.dot(miss) / slope.squaredNorm();
  const double least = 1e-3;
  const double used = std::max(inverse, least);
  const Eigen::Vector3d p = a + used * t;
  if (p.z() <= 1e-3 || (p.head<2>() / p.z() - right).norm() > most_miss) return std::nullopt;
  return 1.0 / used;
}

double farthest_stereo(const Setup& setup) {
  constexpr double kLeastDisparity = 4.0;  // pixels; a ray may be off by one
  if (setup.cameras.size() < 2) return 0;
  const Pose right_from_left =
      setup.cameras[1].body_from_camera.inverse() * setup.cameras[0].body_from_camera;
  return right_from_left.position.norm() * setup.cameras[1].focal() / kLeastDisparity;
}

RayRows rows_of_ray(const Pose& camera, const Eigen::Vector3d& point, const Eigen::Vector2d& ray) {
  const Eigen::Vector3d p = camera.rotation.transpose() * (point - camera.position);
  return {ray - p.head<2>() / p.z(), projection_slope(p) * camera.rotation.transpose()};
}

std::optional<PointFit> fit_of(std::span<const View> views, const Eigen::Vector3d& point,
                               double ray_sigma) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  double squares = 0;
  for (const View& view : views) {
    const RayRows rows = rows_of_ray(view.camera, point, view.ray);
    information += rows.slope.transpose() * rows.slope;
    squares += rows.miss.squaredNorm();
  }
  if (!(information.determinant() > 0)) return std::nullopt;
  PointFit fit;
  fit.rms = std::sqrt(squares / (2.0 * static_cast<double>(views.size())));
  fit.covariance = ray_sigma * ray_sigma * information.inverse();
  if (!fit.covariance.allFinite()) return std::nullopt;
  return fit;
}

PointRows rows_of_track(const State& state, const Setup& setup, const Track& track,
                        const Eigen::Vector3d& point) {
  Eigen::Index count = 0;
  for (const auto& seen : track.seen) count += seen.has_right ? 4 : 2;
  PointRows all;
  all.rows.sigma = setup.pixel_sigma();
  all.rows.residual = Eigen::VectorXd::Zero(count);
  all.to_point = Eigen::MatrixXd::Zero(count, 3);
  const Eigen::Matrix3d turned = cross_matrix(point);
  Eigen::Index at = 0;
  for (const auto& seen : track.seen) {
    const auto index = static_cast<std::size_t>(
        std::ranges::find(state.clones, seen.frame, &Clone::frame) - state.clones.begin());
    JacobianPart part{State::clone_at(index), Eigen::MatrixXd::Zero(count, kCloneSize)};
    for (std::size_t camera = 0; camera < (seen.has_right ? 2U : 1U); ++camera) {
      const Row row = row_of(setup.cameras[camera], state.clones[index].body,
                             camera == 0 ? seen.left : seen.right, point);
      if (row.good) {
        all.rows.residual.segment<2>(at) = row.residual;
        all.to_point.middleRows<2>(at) = row.to_point;
        part.values.block<2, 3>(at, 0) = row.to_point * turned;
        part.values.block<2, 3>(at, 3) = -row.to_point;
      }
      at += 2;
    }
    all.rows.parts.push_back(std::move(part));
  }
  return all;
}

RowBlock compressed_window(const State& state, const std::vector<RowBlock>& blocks) {
  const int first = State::clone_at(static_cast<std::size_t>(state.milestones));
  return compressed(blocks, first, State::clone_at(state.clones.size()) - first);
}

RowBlock rows_of_landmark(const State& state, const Setup& setup, std::size_t landmark,
                          const Observation& seen, double sigma) {
  const Eigen::Index count = seen.has_right ? 4 : 2;
  RowBlock block;
  block.sigma = sigma;
  block.residual = Eigen::VectorXd::Zero(count);
  Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(count, 3);
  for (std::size_t camera = 0; camera < (seen.has_right ? 2U : 1U); ++camera) {
    const Row row =
        row_of(setup.cameras[camera], state.clones.back().body,
               camera == 0 ? seen.left : seen.right, state.landmarks[landmark].position);
    const auto at = static_cast<Eigen::Index>(2 * camera);
    if (!row.good) {
      // Behind the camera: as far off as nothing that is gated lets pass.
      block.residual.segment<2>(at).setConstant(1e6);
      continue;
    }
    block.residual.segment<2>(at) = row.residual;
    slope.middleRows<2>(at) = row.to_point;
  }
  // The rotation errors of landmark and clone are the same and cancel.
  block.parts.push_back({State::clone_at(state.clones.size() - 1) + 3, -slope});
  block.parts.push_back({state.landmark_at(landmark), slope});
  return block;
}

std::vector<View> views_of(const State& state, const Setup& setup, const Track& track) {
  std::vector<View> views;
  for (const auto& seen : track.seen) {
    const Pose& body = clone_of(state, seen.frame).body;
    views.push_back({camera_pose(setup, body, 0), seen.left});
    if (seen.has_right) views.push_back({camera_pose(setup, body, 1), seen.right});
  }
  return views;
}

std::optional<Eigen::Vector2d> pixel_of(const CameraModel& camera, const Pose& pose,
                                        const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = pose.rotation.transpose() * (point - pose.position);
  if (p.z() < kNearest) return std::nullopt;
  const Eigen::Vector2d ray = p.head<2>() / p.z();
  // Beyond its field of view the polynomial of a lens may fold back.
  const double reach = 1.6 * std::hypot(camera.width, camera.height) / (2 * camera.focal());
  if (ray.norm() > reach) return std::nullopt;
  return camera.project(ray);
}

}  // namespace pirt::slam
