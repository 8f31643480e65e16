// The pose found again, or for the first time, without what was known of it: from the map's
// descriptors, or from two views.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "workloads/slam/filter/filter.h"
#include "workloads/slam/filter/map_use.h"
#include "workloads/slam/filter/measure.h"
#include "workloads/slam/filter/milestones.h"
#include "workloads/slam/filter/steps.h"
#include "workloads/slam/views/places.h"
#include "workloads/slam/views/pnp.h"
#include "workloads/slam/views/two_views.h"

namespace pirt::slam {
namespace {

/// How well a pose is known that came from nowhere.
struct Prior {
  double turn_rad, position, velocity, gyro_bias;
};

/// The body is at @p body; all clones go. Landmarks keep their own covariance in the world, biases
/// theirs with an IMU; nothing is correlated with the new pose.
void place_body(State& state, const Setup& setup, const Pose& body, const Prior& prior) {
  const auto count = static_cast<Eigen::Index>(state.landmarks.size());
  Eigen::MatrixXd points(3 * count, 3 * count);
  if (count > 0) {
    const int turn = State::clone_at(state.clones.size() - 1);
    const int first = state.landmark_at(0);
    Eigen::MatrixXd j = Eigen::MatrixXd::Zero(3 * count, 3 * count + 3);
    for (Eigen::Index i = 0; i < count; ++i) {
      j.block<3, 3>(3 * i, 0) =
          -cross_matrix(state.landmarks[static_cast<std::size_t>(i)].position);
      j.block<3, 3>(3 * i, 3 + 3 * i).setIdentity();
    }
    Eigen::MatrixXd p(3 * count + 3, 3 * count + 3);
    const auto& all = state.covariance;
    p << all.block(turn, turn, 3, 3), all.block(turn, first, 3, 3 * count),
        all.block(first, turn, 3 * count, 3), all.block(first, first, 3 * count, 3 * count);
    points = j * p * j.transpose();
  }
  const Eigen::Matrix<double, 6, 6> biases = state.covariance.block<6, 6>(kGyroBiasAt, kGyroBiasAt);
  // What it moved with turns with it.
  state.motion.velocity = body.rotation * state.motion.rotation.transpose() * state.motion.velocity;
  state.motion.rotation = body.rotation;
  state.motion.position = body.position;
  const Eigen::Index n = kMotionSize + 3 * count;
  Eigen::MatrixXd p = Eigen::MatrixXd::Zero(n, n);
  const auto set = [&](int at, double sigma) {
    p.diagonal().segment<3>(at).setConstant(sigma * sigma);
  };
  set(0, prior.turn_rad);
  set(kVelocityAt, prior.velocity);
  set(kPositionAt, prior.position);
  p.block<6, 6>(kGyroBiasAt, kGyroBiasAt) = biases;
  if (!setup.imu) set(kGyroBiasAt, prior.gyro_bias);
  // The invariant position error is p - turn x p^: what is known is p.
  const Eigen::Matrix3d turn_var = p.block<3, 3>(0, 0);
  const Eigen::Matrix3d lever = cross_matrix(body.position);
  p.block<3, 3>(kPositionAt, 0) = lever * turn_var;
  p.block<3, 3>(0, kPositionAt) = turn_var * lever.transpose();
  p.block<3, 3>(kPositionAt, kPositionAt) += lever * turn_var * lever.transpose();
  Eigen::MatrixXd arms(3 * count, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    arms.middleRows<3>(3 * i) = cross_matrix(state.landmarks[static_cast<std::size_t>(i)].position);
  }
  p.bottomRightCorner(3 * count, 3 * count) = points + arms * turn_var * arms.transpose();
  const Eigen::MatrixXd to_turn = arms * turn_var;
  const Eigen::MatrixXd to_position = arms * turn_var * lever.transpose();
  p.block(kMotionSize, 0, 3 * count, 3) = to_turn;
  p.block(0, kMotionSize, 3, 3 * count) = to_turn.transpose();
  p.block(kMotionSize, kPositionAt, 3 * count, 3) = to_position;
  p.block(kPositionAt, kMotionSize, 3, 3 * count) = to_position.transpose();
  state.covariance.swap(p);
  state.clones.clear();
  for (auto& track : state.tracks) track.seen.clear();
}

void follow(State& state, const Features& features, std::size_t feature, std::int64_t landmark) {
  Track track;
  track.id = state.next_id++;
  track.pixel = track.rest = features.pixels[feature];
  track.landmark = landmark;
  track.descriptor = features.descriptors[feature];
  state.tracks.push_back(std::move(track));
}

/// Poses of all clones from those of the first and the last, by the points that both see.
bool place_clones(State& state, const Setup& setup, const Pose& last_camera) {
  const Pose& mount = setup.cameras[0].body_from_camera;
  const Pose first_camera = state.clones.front().body * mount;
  const double ray_sigma = 1.0 / setup.cameras[0].focal();
  const std::int64_t first = state.clones.front().frame;
  const std::int64_t last = state.clones.back().frame;
  struct Known {
    const Track* track;
    Eigen::Vector3d point;
  };
  std::vector<Known> known;
  std::vector<double> depths, scales;
  std::size_t paired = 0;
  const double farthest = farthest_stereo(setup);
  constexpr double kAnyMiss = std::numeric_limits<double>::max();  // they were checked before
  for (const auto& track : state.tracks) {
    if (track.seen.empty() || track.seen.front().frame != first) continue;
    if (track.seen.back().frame != last) continue;
    const std::vector<View> views = {{first_camera, track.seen.front().left},
                                     {last_camera, track.seen.back().left}};
    const auto point = triangulate(views, ray_sigma);
    if (!point || point->rms > 2 * ray_sigma) continue;
    known.push_back({&track, point->point});
    depths.push_back(point->depth);
    for (const auto& [camera, seen] :
         {std::pair(first_camera, track.seen.front()), std::pair(last_camera, track.seen.back())}) {
      if (!seen.has_right) continue;
      ++paired;
      const auto depth = stereo_depth(setup, seen.left, seen.right, kAnyMiss);
      if (depth && *depth < farthest) {
        scales.push_back(*depth / (camera.inverse() * point->point).z());
      }
    }
  }
  constexpr std::size_t kLeast = 20;
  if (known.size() < kLeast) return false;
  // The unit of length of a single camera: half of the points are nearer than this.
  constexpr double kMedianDepth = 5.0;
  const bool knows = scales.size() >= kLeastStereo && sees_stereo(paired, 2 * known.size());
  const double scale = knows ? median(scales) : kMedianDepth / median(depths);
  for (std::size_t i = 1; i < state.clones.size(); ++i) {
    Pose camera = last_camera;
    if (i + 1 < state.clones.size()) {
      std::vector<PointMatch> matches;
      for (const auto& [track, point] : known) {
        const auto seen =
            std::ranges::find(track->seen, state.clones[i].frame, &Observation::frame);
        if (seen != track->seen.end()) matches.push_back({point, seen->left});
      }
      const auto found = robust_pnp(matches, 2 * ray_sigma);
      if (!found) return false;
      camera = found->camera;
    }
    camera.position = first_camera.position + scale * (camera.position - first_camera.position);
    state.clones[i].body = camera * mount.inverse();
  }
  return true;
}

}  // namespace

bool start_from_tracks(State& state, const Setup& setup) {
  constexpr std::size_t kLeastClones = 5;
  constexpr std::size_t kLeastTracks = 30;
  constexpr double kLeastMotion = 12.0;  // pixels, median
  if (state.clones.size() < kLeastClones) return false;
  std::vector<RayPair> pairs;
  std::vector<double> moved;
  for (const auto& track : state.tracks) {
    if (track.seen.empty() || track.seen.front().frame != state.clones.front().frame) continue;
    const auto& a = track.seen.front().left;
    const auto& b = track.seen.back().left;
    pairs.push_back({a, b});
    moved.push_back((a - b).norm() * setup.cameras[0].focal());
  }
  if (pairs.size() < kLeastTracks) {
    // What the first picture showed is gone: begin anew from here.
    while (state.clones.size() > 1) remove_clone(state, 0);
    return false;
  }
  std::ranges::nth_element(moved, moved.begin() + std::ssize(moved) / 2);
  if (moved[moved.size() / 2] < kLeastMotion) return false;
  const auto motion = two_views(pairs, 1.0 / setup.cameras[0].focal());
  if (!motion) return false;
  const Pose first_camera = camera_pose(setup, state.clones.front().body, 0);
  if (!place_clones(state, setup, first_camera * *motion)) return false;

  // The first clone is the world's; the others are known roughly, and tracks say the rest.
  const auto n = state.clones.size();
  const Pose& last = state.clones[n - 1].body;
  const Pose& before = state.clones[n - 2].body;
  const double base = (last.position - state.clones.front().body.position).norm();
  const double dt = to_s(state.time - state.previous_time);
  state.motion.rotation = last.rotation;
  state.motion.position = last.position;
  state.motion.velocity = (last.position - before.position) / dt;
  state.motion.gyro_bias = -vector_of(before.rotation.transpose() * last.rotation) / dt;
  const auto size = kMotionSize + kCloneSize * static_cast<Eigen::Index>(n - 1);
  Eigen::VectorXd sigma = Eigen::VectorXd::Constant(size, 1e-6);
  constexpr double kTurn = 0.01;
  const double position = 0.05 * base;
  sigma.segment<3>(0).setConstant(kTurn);
  sigma.segment<3>(kVelocityAt).setConstant(0.3 * state.motion.velocity.norm());
  sigma.segment<3>(kPositionAt).setConstant(position);
  sigma.segment<3>(kGyroBiasAt).setConstant(0.02 / dt);
  for (std::size_t i = 1; i + 1 < n; ++i) {
    sigma.segment<3>(State::clone_at(i)).setConstant(kTurn);
    sigma.segment<3>(State::clone_at(i) + 3).setConstant(position);
  }
  state.covariance = sigma.cwiseAbs2().asDiagonal();
  const std::int64_t frame = state.clones.back().frame;
  state.clones.pop_back();
  add_clone(state, frame);
  // extend_map takes what the tracks have seen, now that there are poses.
  state.status = Status::kTracking;
  return true;
}

namespace {

/// All that may be known again: landmarks, the run's own points, and those of a map that was found.
struct KnownPlaces {
  std::vector<KnownPlace> places;
  std::vector<std::size_t> known;  ///< Indices of those that come last.
  std::size_t landmarks = 0, own = 0;

  KnownPlaces(const State& state, const Setup& setup)
      : landmarks(state.landmarks.size()), own(state.map.size()) {
    for (const auto& each : state.landmarks) add(each);
    for (const auto& each : state.map) add(each);
    if (!state.in_map || setup.known == nullptr) return;
    for (std::size_t i = 0; i < setup.known->size(); ++i) {
      if (is_taken(state, i)) continue;
      add((*setup.known)[i]);
      known.push_back(i);
    }
  }
  void add(const auto& point) {
    places.push_back({&point.descriptor, &point.position, &point.seen_from});
  }
  [[nodiscard]] bool is_landmark(std::size_t place) const { return place < landmarks; }
  [[nodiscard]] bool is_own(std::size_t place) const {
    return place >= landmarks && place < landmarks + own;
  }
};

/// Points of maps that a view shows: they are landmarks from now on.
class NewLandmarks {
 public:
  NewLandmarks(State& state, const Setup& setup, const KnownPlaces& known)
      : state_(state), setup_(setup), known_(known) {}

  [[nodiscard]] bool has_room() const {
    return std::ssize(state_.landmarks) + std::ssize(points_) < setup_.most_landmarks;
  }
  std::int64_t add(std::size_t place) {
    const std::size_t outside = place - known_.landmarks;
    const bool own = known_.is_own(place);
    if (own) own_.push_back(outside);
    if (!own) taken_.push_back(known_.known[outside - known_.own]);
    points_.push_back(own ? &state_.map[outside] : &(*setup_.known)[taken_.back()]);
    ids_.push_back(points_.back()->id >= 0 ? points_.back()->id : state_.next_id++);
    return ids_.back();
  }
  /// Before place_body().
  void insert() {
    std::vector<Landmark> landmarks;
    const auto n = 3 * std::ssize(points_);
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
    for (std::size_t i = 0; i < points_.size(); ++i) {
      Landmark& landmark = landmarks.emplace_back();
      landmark.id = ids_[i];
      landmark.position = points_[i]->position;
      landmark.descriptor = points_[i]->descriptor;
      landmark.seen_from = points_[i]->seen_from;
      landmark.last_frame = state_.frame;
      const auto at = static_cast<Eigen::Index>(3 * i);
      covariance.block<3, 3>(at, at) = points_[i]->covariance;
    }
    add_known_landmarks(state_, landmarks, covariance);
    for (const std::size_t i : taken_) take(state_, i);
    std::ranges::sort(own_, std::greater<>());
    for (const std::size_t i : own_) {
      state_.map.erase(state_.map.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }

 private:
  State& state_;
  const Setup& setup_;
  const KnownPlaces& known_;
  std::vector<const MapPoint*> points_;
  std::vector<std::int64_t> ids_;
  std::vector<std::size_t> own_, taken_;
};

}  // namespace

bool relocalize(State& state, const Setup& setup, const Features& features) {
  constexpr std::size_t kLeastInliers = 12;
  const KnownPlaces known(state, setup);
  const auto matches = match_places(features, known.places, features.pixels.size());
  std::vector<PointMatch> points;
  for (const auto& match : matches) {
    points.push_back({*known.places[match.place].position,
                      setup.cameras[0].ray(features.pixels[match.feature].cast<double>())});
  }
  const double most_miss = 4.0 / setup.cameras[0].focal();
  const auto found = robust_pnp(points, most_miss);
  if (!found || found->inliers.size() < kLeastInliers) return false;
  if (3 * found->inliers.size() < points.size()) return false;
  std::vector<double> depths;
  std::vector<std::pair<std::size_t, std::int64_t>> followed;
  NewLandmarks added(state, setup, known);
  for (const std::size_t i : found->inliers) {
    depths.push_back((found->camera.inverse() * points[i].point).z());
    const PlaceMatch& match = matches[i];
    if (known.is_landmark(match.place)) {
      followed.emplace_back(match.feature, state.landmarks[match.place].id);
    } else if (added.has_room()) {
      followed.emplace_back(match.feature, added.add(match.place));
    }
  }
  forget_milestones(state);
  added.insert();
  std::ranges::nth_element(depths, depths.begin() + std::ssize(depths) / 2);
  const double depth = depths[depths.size() / 2];
  const Pose body = found->camera * setup.cameras[0].body_from_camera.inverse();
  if (!setup.imu) {
    state.motion.velocity.setZero();
    state.motion.gyro_bias.setZero();
  }
  place_body(state, setup, body, {0.02, 0.03 * depth, setup.imu ? 0.3 : 0.5 * depth, 0.5});
  std::erase_if(state.tracks, [](const Track& track) { return track.landmark >= 0; });
  for (const auto& [feature, landmark] : followed) follow(state, features, feature, landmark);
  add_clone(state, state.frame + 1);
  state.status = Status::kTracking;
  state.blind_frames = 0;
  return true;
}

}  // namespace pirt::slam
