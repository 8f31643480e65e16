#include "workloads/mapping/keyframes.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/slam/filter/filter.h"
#include "workloads/slam/filter/measure.h"
#include "workloads/slam/filter/milestones.h"

namespace pirt::mapping {
namespace {

constexpr std::size_t kLeastViews = 3;
constexpr std::ptrdiff_t kLeastPoints = 12;
constexpr double kMostRelativeSigma = 0.3;  // of a point's depth
constexpr double kLeastSigma_m = 1e-3;      // the first keyframe's is 0: the world begins there
constexpr double kLeastTurn_rad = 1e-4;
constexpr double kMounted = 1e-5;  // rad and m: how well cameras on one board are known

/// From the camera's axes (x right, y down, z ahead) to those of bal.h (y up, -z ahead), and back.
const Eigen::DiagonalMatrix<double, 3> kFlip(1, -1, -1);

void append_camera(const Pose& camera, double focal, std::vector<double>& cameras) {
  const Pose from_world = camera.inverse();
  const Eigen::Vector3d turn = vector_of(kFlip * from_world.rotation);
  const Eigen::Vector3d moved = kFlip * from_world.position;
  cameras.insert(cameras.end(), turn.data(), turn.data() + 3);
  cameras.insert(cameras.end(), moved.data(), moved.data() + 3);
  cameras.insert(cameras.end(), {focal, 0, 0});
}

/// Camera to world.
Pose pose_of(std::span<const double> camera) {
  const Eigen::Matrix3d rotation = kFlip * rotation_of(Eigen::Vector3d(camera.data()));
  const Eigen::Vector3d moved = kFlip * Eigen::Vector3d(camera.data() + 3);
  return Pose{rotation, moved}.inverse();
}

/// @param way  From the camera @p to to the camera @p from.
RelativePose relative_of(std::size_t from, std::size_t to, const Pose& way, double px_per_rad,
                         double px_per_unit) {
  const Pose there = way.inverse();
  const Eigen::Vector3d turn = vector_of(kFlip * there.rotation * kFlip);
  const Eigen::Vector3d move = kFlip * there.position;
  return {.from = static_cast<std::int32_t>(from),
          .to = static_cast<std::int32_t>(to),
          .turn = {turn.x(), turn.y(), turn.z()},
          .move = {move.x(), move.y(), move.z()},
          .px_per_rad = px_per_rad,
          .px_per_unit = px_per_unit};
}

/// Of the way from a clone of @p frame to the newest pose.
std::optional<Step> step_since(const slam::State& state, std::int64_t frame) {
  const auto clone = std::ranges::find(state.clones, frame, &slam::Clone::frame);
  if (clone == state.clones.end()) return std::nullopt;
  const int then = slam::State::clone_at(static_cast<std::size_t>(clone - state.clones.begin()));
  // turn = b - a; place = b - a + turn x where it is now.
  Eigen::Matrix<double, 6, 12> j = Eigen::Matrix<double, 6, 12>::Zero();
  const Eigen::Matrix3d unit = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d arm = cross_matrix(state.motion.position);
  j << -unit, Eigen::Matrix3d::Zero(), unit, Eigen::Matrix3d::Zero(),  //
      arm, -unit, -arm, unit;
  const auto& p = state.covariance;
  std::array<Eigen::Index, 12> rows{};
  for (int i = 0; i < 6; ++i) rows[static_cast<std::size_t>(i)] = then + i;
  for (int i = 0; i < 3; ++i) {
    rows[static_cast<std::size_t>(6 + i)] = i;
    rows[static_cast<std::size_t>(9 + i)] = slam::kPositionAt + i;
  }
  const Eigen::Matrix<double, 12, 12> both = p(rows, rows);
  const Eigen::Matrix<double, 6, 1> variance = (j * both * j.transpose()).diagonal();
  return Step{clone->body.inverse() * state.body(),
              std::sqrt(std::max(0.0, variance.head<3>().mean())),
              std::sqrt(std::max(0.0, variance.tail<3>().mean()))};
}

/// What takes adjusted cameras back to where they were: the mean of their turns and places, and of
/// one camera the mean of their distances.
Similarity back_to(std::span<const Pose> before, std::span<const Pose> after, bool scaled) {
  const auto count = static_cast<double>(before.size());
  const Eigen::Matrix3d first = before[0].rotation * after[0].rotation.transpose();
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  Eigen::Vector3d old_centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d new_centre = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < before.size(); ++i) {
    const Eigen::Matrix3d each = before[i].rotation * after[i].rotation.transpose();
    turn += vector_of(each * first.transpose()) / count;
    old_centre += before[i].position / count;
    new_centre += after[i].position / count;
  }
  Similarity back;
  back.pose.rotation = rotation_of(turn) * first;
  double along = 0;
  double square = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const Eigen::Vector3d moved = back.pose.rotation * (after[i].position - new_centre);
    along += moved.dot(before[i].position - old_centre);
    square += moved.squaredNorm();
  }
  if (scaled && square > 0) back.scale = along / square;
  back.pose.position = old_centre - back.scale * (back.pose.rotation * new_centre);
  return back;
}

}  // namespace

Keyframes::Keyframes(slam::Setup setup, KeyframeOptions options)
    : setup_(std::move(setup)), options_(options) {
  // What the workload has room for is cameras.
  options_.most = std::max<std::size_t>(3, options_.most / setup_.cameras.size());
}

bool Keyframes::add(const slam::State& state) {
  for (const slam::Track& track : state.tracks) {
    if (track.landmark >= 0) landmarks_[track.id] = track.landmark;
  }
  if (state.status != slam::Status::kTracking) return false;
  follow_milestones(state);
  const Pose body = state.body();
  if (!keyframes_.empty()) {
    const Pose moved = keyframes_.back().pose.body.inverse() * body;
    if (moved.position.norm() < options_.least_move_m &&
        angle_of(moved.rotation) < options_.least_turn_rad) {
      return false;
    }
  }
  if (keyframes_.size() >= options_.most) thin_out();
  const std::int64_t before = keyframes_.empty() ? -1 : keyframes_.back().frame;
  Keyframe& made = keyframes_.emplace_back();
  made.step = step_since(state, before);
  made.pose = {state.time, body};
  made.frame = state.frame;
  // Where nothing is uncertain, rounding may leave less than 0.
  made.sigma_m = std::sqrt(std::max(0.0, slam::position_covariance(state).trace() / 3));
  made.sigma_rad = std::sqrt(std::max(0.0, state.covariance.topLeftCorner<3, 3>().trace() / 3));
  made.milestone = slam::nearest_milestone(state, body.position);
  const auto near = step_since(state, made.milestone);
  made.near_sigma_m = near ? near->move_m : made.sigma_m;
  for (const slam::Track& track : state.tracks) {
    Sighting& seen = made.seen.emplace_back();
    seen.point = track.id;
    seen.ray = setup_.cameras[0].ray(track.pixel.cast<double>());
    if (track.has_right) seen.right = setup_.cameras[1].ray(track.right_pixel.cast<double>());
    seen.descriptor = track.descriptor;
  }
  return true;
}

void Keyframes::follow_milestones(const slam::State& state) {
  for (Keyframe& each : keyframes_) {
    if (slam::find_milestone(state, each.milestone) == nullptr) {
      each.milestone = slam::nearest_milestone(state, each.pose.body.position);
    }
    const auto before = std::ranges::find(milestones_, each.milestone, &slam::Clone::frame);
    if (before == milestones_.end()) continue;
    const Pose& now = slam::find_milestone(state, each.milestone)->body;
    each.pose.body = now * (before->body.inverse() * each.pose.body);
  }
  milestones_.assign(state.clones.begin(), state.clones.begin() + state.milestones);
}

void Keyframes::thin_out() {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < keyframes_.size(); i += 2) {
    Keyframe& each = keyframes_[i];
    // Two steps are one.
    const auto before = i > 0 ? keyframes_[i - 1].step : std::nullopt;
    if (each.step && before) {
      each.step =
          Step{before->way * each.step->way, std::hypot(each.step->turn_rad, before->turn_rad),
               std::hypot(each.step->move_m, before->move_m)};
    } else {
      each.step.reset();
    }
    if (kept != i) keyframes_[kept] = std::move(each);
    ++kept;
  }
  keyframes_.resize(kept);
  options_.least_move_m *= 2;
  options_.least_turn_rad *= 2;
}

std::size_t Keyframes::camera_count() const { return keyframes_.size() * setup_.cameras.size(); }

Pose Keyframes::camera(std::size_t index) const {
  return slam::camera_pose(setup_, keyframes_[index % keyframes_.size()].pose.body,
                           index / keyframes_.size());
}

template <typename Cameras>
std::vector<slam::View> Keyframes::rays_of(std::span<const View> views,
                                           const Cameras& cameras) const {
  std::vector<slam::View> rays;
  for (const View& each : views) {
    rays.push_back({cameras(each.keyframe), each.seen->ray});
    if (each.seen->right) {
      rays.push_back({cameras(keyframes_.size() + each.keyframe), *each.seen->right});
    }
  }
  return rays;
}

std::vector<Keyframes::Point> Keyframes::points() const {
  std::map<std::int64_t, std::vector<View>> seen;
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    for (const Sighting& sighting : keyframes_[i].seen) {
      const auto landmark = landmarks_.find(sighting.point);
      seen[landmark == landmarks_.end() ? sighting.point : landmark->second].push_back(
          {i, &sighting});
    }
  }
  std::vector<Point> points;
  for (auto& [id, views] : seen) {
    if (views.size() < kLeastViews) continue;
    const auto rays = rays_of(views, [this](std::size_t index) { return camera(index); });
    const double sigma = setup_.ray_sigma_rad;
    const auto point = slam::triangulate(rays, sigma);
    if (!point || point->rms > 3 * sigma || point->relative_sigma > kMostRelativeSigma) continue;
    points.push_back({id, point->point, std::move(views)});
  }
  return points;
}

BalProblem Keyframes::problem() const {
  const auto points = this->points();
  std::vector<std::ptrdiff_t> seen_by(keyframes_.size());
  for (const Point& point : points) {
    for (const View& each : point.views) ++seen_by[each.keyframe];
  }
  const double focal = setup_.cameras[0].focal();
  BalProblem problem;
  for (std::size_t i = 0; i < camera_count(); ++i) {
    append_camera(camera(i), focal, problem.cameras);
  }
  for (const Point& point : points) {
    const auto index = static_cast<std::int32_t>(problem.point_count());
    problem.points.insert(problem.points.end(), point.place.data(), point.place.data() + 3);
    const auto observe = [&](std::size_t camera, const Eigen::Vector2d& ray) {
      problem.observations.push_back(
          {static_cast<std::int32_t>(camera), index, focal * ray.x(), -focal * ray.y()});
    };
    for (const View& each : point.views) {
      if (seen_by[each.keyframe] < kLeastPoints) continue;
      observe(each.keyframe, each.seen->ray);
      if (each.seen->right) observe(keyframes_.size() + each.keyframe, *each.seen->right);
    }
  }
  return problem;
}

// Weights of priors and ways are against what an observation is off by: what the window has drifted
// by, as a landmark's.

std::vector<PosePrior> Keyframes::priors() const {
  std::vector<PosePrior> priors;
  // A drift is one error of all of them: together they weigh as one.
  const double alone = std::sqrt(static_cast<double>(keyframes_.size()));
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    PosePrior& prior = priors.emplace_back();
    prior.camera = static_cast<std::int32_t>(i);
    const Eigen::Vector3d place = camera(i).position;
    std::ranges::copy(place, prior.centre.begin());
    prior.px_per_unit =
        setup_.landmark_sigma / (alone * std::max(keyframes_[i].sigma_m, kLeastSigma_m));
    const Eigen::Vector3d turn = vector_of(kFlip * camera(i).inverse().rotation);
    std::ranges::copy(turn, prior.turn.begin());
    prior.px_per_rad =
        setup_.landmark_sigma / (alone * std::max(keyframes_[i].sigma_rad, kLeastTurn_rad));
  }
  return priors;
}

std::vector<RelativePose> Keyframes::relative() const {
  std::vector<RelativePose> all;
  const std::size_t count = keyframes_.size();
  const Pose& left = setup_.cameras[0].body_from_camera;
  for (std::size_t i = count; i < camera_count(); ++i) {
    const double weight = setup_.landmark_sigma / kMounted;
    const Pose mounted = left.inverse() * setup_.cameras[1].body_from_camera;
    all.push_back(relative_of(i - count, i, mounted, weight, weight));
  }
  for (std::size_t i = 1; i < count; ++i) {
    const auto& step = keyframes_[i].step;
    if (!step) continue;
    all.push_back(relative_of(i - 1, i, left.inverse() * step->way * left,
                              setup_.landmark_sigma / std::max(step->turn_rad, kLeastTurn_rad),
                              setup_.landmark_sigma / std::max(step->move_m, kLeastSigma_m)));
  }
  return all;
}

RefinedMap Keyframes::refined(const BalProblem& adjusted) const {
  if (keyframes_.empty() || adjusted.camera_count() != camera_count()) {
    throw_bad_input(fmt::format("{} cameras cannot be the poses of {} keyframes",
                                adjusted.camera_count(), keyframes_.size()));
  }
  std::vector<bool> adjusts(camera_count());
  for (const Observation& seen : adjusted.observations) {
    adjusts[static_cast<std::size_t>(seen.camera)] = true;
  }
  // Of cameras, since a map that shrinks leaves the way from the camera to the body as it is.
  std::vector<Pose> before, after;
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    if (!adjusts[i]) continue;
    before.push_back(camera(i));
    after.push_back(pose_of(std::span(adjusted.cameras).subspan(i * kCameraSize, kCameraSize)));
  }
  if (after.size() < 3) {
    throw_bad_input(
        fmt::format("{} keyframes that see enough cannot be adjusted; it takes 3", after.size()));
  }
  const Similarity back = back_to(before, after, setup_.cameras.size() == 1);
  const Pose camera_from_body = setup_.cameras[0].body_from_camera.inverse();
  RefinedMap map;
  for (std::size_t i = 0, next = 0; i < keyframes_.size(); ++i) {
    map.keyframes.push_back(keyframes_[i].pose);
    if (!adjusts[i]) continue;
    map.keyframes.back().body = moved(back, after[next++]) * camera_from_body;
  }
  map.points = map_points(adjusted, back);
  map.milestones = milestones_;
  return map;
}

std::vector<slam::MapPoint> Keyframes::map_points(const BalProblem& adjusted,
                                                  const Similarity& back) const {
  const auto cameras = [&](std::size_t index) {
    return moved(back,
                 pose_of(std::span(adjusted.cameras).subspan(index * kCameraSize, kCameraSize)));
  };
  const auto points = this->points();
  std::vector<slam::MapPoint> made;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point& point = points[i];
    slam::MapPoint better;
    better.id = point.id;
    better.position = back * Eigen::Vector3d(&adjusted.points[i * kPointSize]);
    const auto rays = rays_of(point.views, cameras);
    double variance = 0;
    for (const View& each : point.views) {
      const double sigma_m = keyframes_[each.keyframe].near_sigma_m;
      variance += sigma_m * sigma_m / static_cast<double>(point.views.size());
    }
    const double sigma = setup_.ray_sigma_rad;
    const auto fit = slam::fit_of(rays, better.position, sigma);
    constexpr double kMostRms = 0.7;  // of sigma: outliers are no points
    if (!fit || fit->rms > kMostRms * sigma) continue;
    const View& first = point.views.front();
    better.descriptor = first.seen->descriptor;
    better.seen_from = cameras(first.keyframe).position;
    // Described as it was seen first; what follows is of a track that drifts, and tells of its
    // range, but across no more than one ray does: found again, points are off by 0.8 px (median).
    const Eigen::Vector3d arm = better.position - better.seen_from;
    const Eigen::Matrix3d across =
        arm.squaredNorm() * Eigen::Matrix3d::Identity() - arm * arm.transpose();
    better.covariance =
        fit->covariance + sigma * sigma * across + variance * Eigen::Matrix3d::Identity();
    better.milestone = keyframes_[first.keyframe].milestone;
    better.last_frame = keyframes_[point.views.back().keyframe].frame;
    made.push_back(better);
  }
  return made;
}

slam::BetterMap better_map(const RefinedMap& refined, bool in_map) {
  slam::BetterMap better{.points = refined.points, .in_map = in_map};
  for (slam::MapPoint& point : better.points) {
    const auto its = std::ranges::find(refined.milestones, point.milestone, &slam::Clone::frame);
    if (its == refined.milestones.end()) {
      point.milestone = -1;
    } else {
      slam::move_point(point, {1.0, its->body.inverse()});
    }
  }
  return better;
}

RefinedMap refine(const Keyframes& keyframes) {
  BalProblem problem = keyframes.problem();
  if (problem.observations.empty()) {
    throw_bad_input(
        fmt::format("{} keyframes share no points that could be adjusted", keyframes.all().size()));
  }
  BundleOptions options = robot_options();
  options.priors = keyframes.priors();
  options.relative = keyframes.relative();
  const BundleSummary summary = bundle_adjust(problem, options);
  RefinedMap map = keyframes.refined(problem);
  map.summary = summary;
  return map;
}

}  // namespace pirt::mapping
