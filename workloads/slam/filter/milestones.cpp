#include "workloads/slam/filter/milestones.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>
#include <utility>

namespace pirt::slam {
namespace {

constexpr double kNearShare = 0.25;  // of the depth: what is nearer to a milestone needs none
// Points that were seen together are off together; as if each were alone, they say less. With 4,
// four flights of a minute had a mean NEES of 8.5 with one camera, with 16 of 5.6 (of 5.6 and 5.4
// with two), and were off by as much: what points share, more of them do not tell.
constexpr double kTogether = 16.0;  // in variance
constexpr double kTurnArm = 0.25;   // of the depth, for a turn of a radian

/// How much two poses' views differ, as a way.
double apart(const Pose& a, const Pose& b, double depth) {
  return (a.position - b.position).norm() +
         kTurnArm * depth * angle_of(a.rotation.transpose() * b.rotation);
}

RowBlock of_a_place() {
  RowBlock block;
  block.residual = Eigen::VectorXd::Zero(3);
  return block;
}

std::size_t index_of(const State& state, std::int64_t milestone) {
  const auto end = state.clones.begin() + state.milestones;
  return static_cast<std::size_t>(
      std::ranges::lower_bound(state.clones.begin(), end, milestone, {}, &Clone::frame) -
      state.clones.begin());
}

/// Error of a place in the world, turn x place + error, of a pose's errors.
Eigen::Matrix<double, 3, 6> place_of_pose(const Eigen::Vector3d& place) {
  Eigen::Matrix<double, 3, 6> j;
  j << -cross_matrix(place), Eigen::Matrix3d::Identity();
  return j;
}

/// Its points are known against another one from now on.
void remove_milestone(State& state, std::size_t index) {
  const std::int64_t frame = state.clones[index].frame;
  for (MapPoint& point : state.map) {
    if (point.milestone != frame) continue;
    double least = std::numeric_limits<double>::max();
    std::size_t other = index;
    for (std::size_t i = 0; std::cmp_less(i, state.milestones); ++i) {
      const double way = (state.clones[i].body.position - point.seen_from).norm();
      if (i != index && way < least) least = way, other = i;
    }
    change_milestone(state, point, state.clones[other].frame);
  }
  remove_clone(state, index);
}

/// The newer one of the two milestones that are nearest to each other, and how near.
std::pair<std::size_t, double> least_needed(const State& state, double depth) {
  std::pair<std::size_t, double> least{0, std::numeric_limits<double>::max()};
  for (std::size_t i = 0; std::cmp_less(i, state.milestones); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const double way = apart(state.clones[i].body, state.clones[k].body, depth);
      if (way < least.second) least = {i, way};
    }
  }
  return least;
}

}  // namespace

void leave_window(State& state, const Setup& setup, double depth) {
  const auto index = static_cast<std::size_t>(state.milestones);
  double way = std::numeric_limits<double>::max();
  for (std::size_t i = 0; i < index; ++i) {
    way = std::min(way, apart(state.clones[i].body, state.clones[index].body, depth));
  }
  const bool wanted = setup.recognize && setup.update && setup.most_milestones > 1 &&
                      state.status == Status::kTracking && way > kNearShare * depth;
  if (!wanted) {
    remove_clone(state, index);
    return;
  }
  if (state.milestones >= setup.most_milestones) {
    const auto [goes, nearest] = least_needed(state, depth);
    if (way < nearest) {
      remove_clone(state, index);
      return;
    }
    remove_milestone(state, goes);
  }
  const std::int64_t frame = state.clones[static_cast<std::size_t>(state.milestones)].frame;
  for (auto& track : state.tracks) {
    std::erase_if(track.seen, [&](const Observation& seen) { return seen.frame == frame; });
  }
  ++state.milestones;
}

MapPoint map_point_of(const State& state, std::size_t landmark) {
  const Landmark& gone = state.landmarks[landmark];
  MapPoint point{
      gone.id,        gone.position,   landmark_covariance(state, landmark),    gone.descriptor,
      gone.seen_from, gone.last_frame, nearest_milestone(state, gone.seen_from)};
  if (point.milestone < 0) return point;
  RowBlock off = of_a_place();
  off.parts.push_back({State::clone_at(state.clones.size() - 1), -cross_matrix(gone.position)});
  off.parts.push_back({state.landmark_at(landmark), Eigen::Matrix3d::Identity()});
  off.parts.push_back(
      {State::clone_at(index_of(state, point.milestone)), -place_of_pose(gone.position)});
  constexpr double kLeast = 1e-10;  // so that it is positive definite for certain
  point.covariance = predicted_covariance(state, off) + kLeast * Eigen::Matrix3d::Identity();
  return point;
}

std::int64_t nearest_milestone(const State& state, const Eigen::Vector3d& place) {
  const auto milestones = std::span(state.clones).first(static_cast<std::size_t>(state.milestones));
  if (milestones.empty()) return -1;
  return std::ranges::min_element(
             milestones, {},
             [&](const Clone& clone) { return (clone.body.position - place).squaredNorm(); })
      ->frame;
}

JacobianPart moves_with(const State& state, const MapPoint& point) {
  return {State::clone_at(index_of(state, point.milestone)), place_of_pose(point.position)};
}

const Clone* find_milestone(const State& state, std::int64_t milestone) {
  const std::size_t index = index_of(state, milestone);
  const bool there = std::cmp_less(index, state.milestones);
  return there && state.clones[index].frame == milestone ? &state.clones[index] : nullptr;
}

void change_milestone(const State& state, MapPoint& point, std::int64_t milestone) {
  if (point.milestone == milestone) return;
  RowBlock off = of_a_place();
  off.parts.push_back(moves_with(state, point));
  if (milestone >= 0) {
    off.parts.push_back(
        {State::clone_at(index_of(state, milestone)), -place_of_pose(point.position)});
  }
  point.covariance += predicted_covariance(state, off);
  point.milestone = milestone;
}

Eigen::Matrix3d shared_covariance(const MapPoint& point) { return kTogether * point.covariance; }

Eigen::Matrix3d world_covariance(const State& state, const MapPoint& point) {
  if (point.milestone < 0) return point.covariance;
  RowBlock off = of_a_place();
  off.parts.push_back(moves_with(state, point));
  return shared_covariance(point) + predicted_covariance(state, off);
}

NewLandmark landmark_of(const State& state, const MapPoint& point) {
  NewLandmark made;
  made.landmark.id = point.id;
  made.landmark.position = point.position;
  made.landmark.descriptor = point.descriptor;
  made.landmark.seen_from = point.seen_from;
  // What the landmark's error and the newest clone's turn make of the place differs from what the
  // milestone makes of it by the point's own error.
  constexpr double kLeast = 1e-10;
  const Eigen::LLT<Eigen::Matrix3d> root(shared_covariance(point) +
                                         kLeast * Eigen::Matrix3d::Identity());
  const Eigen::Matrix3d whiten = root.matrixL().solve(Eigen::Matrix3d::Identity());
  made.to_point = whiten;
  made.block.residual = Eigen::VectorXd::Zero(3);
  made.block.parts.push_back(
      {State::clone_at(state.clones.size() - 1), -whiten * cross_matrix(point.position)});
  JacobianPart milestone = moves_with(state, point);
  milestone.values = -whiten * milestone.values;
  made.block.parts.push_back(std::move(milestone));
  return made;
}

void forget_milestones(State& state) {
  for (MapPoint& point : state.map) {
    if (point.milestone >= 0) change_milestone(state, point, -1);
  }
  while (state.milestones > 0) remove_clone(state, 0);
}

}  // namespace pirt::slam
