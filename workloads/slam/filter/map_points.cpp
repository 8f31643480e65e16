#include "workloads/slam/filter/map_points.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <map>
#include <unordered_map>
#include <unordered_set>

#include "workloads/slam/filter/filter.h"
#include "workloads/slam/filter/milestones.h"

namespace pirt::slam {
namespace {

/// Of two estimates whose errors may be the same, that of the least trace.
void intersect(MapPoint& point, const MapPoint& other) {
  const Eigen::Matrix3d mine = point.covariance.inverse();
  const Eigen::Matrix3d theirs = other.covariance.inverse();
  const Eigen::Vector3d my_part = mine * point.position;
  const Eigen::Vector3d their_part = theirs * other.position;
  constexpr int kParts = 10;
  double least = point.covariance.trace();
  for (int i = 1; i <= kParts; ++i) {
    const double part = static_cast<double>(i) / kParts;
    const Eigen::Matrix3d inverse = ((1 - part) * mine + part * theirs).inverse();
    const Eigen::Matrix3d covariance = 0.5 * (inverse + inverse.transpose());
    const bool is_covariance =
        covariance.allFinite() && Eigen::LLT<Eigen::Matrix3d>(covariance).info() == Eigen::Success;
    if (!is_covariance || covariance.trace() >= least) continue;
    least = covariance.trace();
    point.covariance = covariance;
    point.position = covariance * ((1 - part) * my_part + part * their_part);
  }
}

/// A point of a better map as it is in the world now.
/// @return  False if its milestone has gone: nothing tells where it is any more.
bool place(const State& state, bool in_map, MapPoint& point) {
  const bool moves = state.in_map && !in_map;  // The map was found since.
  if (point.milestone < 0) {
    if (moves) move_point(point, state.map_from_start);
    return true;
  }
  const Clone* its = find_milestone(state, point.milestone);
  if (its == nullptr) return false;
  move_point(point, {moves ? state.map_from_start.scale : 1.0, its->body});
  return true;
}

}  // namespace

void add_map_point(State& state, const Setup& setup, const MapPoint& point) {
  if (setup.most_map_points <= 0) return;
  if (std::ssize(state.map) >= setup.most_map_points) {
    std::map<std::int64_t, int> counts;
    for (const MapPoint& each : state.map) ++counts[each.milestone];
    const auto most =
        std::ranges::max_element(counts, {}, [](const auto& of) { return of.second; });
    state.map.erase(std::ranges::min_element(state.map, {}, [&](const MapPoint& each) {
      return each.milestone == most->first ? each.last_frame
                                           : std::numeric_limits<std::int64_t>::max();
    }));
  }
  state.map.push_back(point);
}

bool is_followed(const State& state, std::int64_t landmark) {
  return std::ranges::any_of(state.tracks,
                             [&](const Track& track) { return track.landmark == landmark; });
}

std::size_t make_room(State& state, const Setup& setup, std::size_t wanted) {
  const auto most = static_cast<std::size_t>(setup.most_landmarks);
  struct Unseen {
    std::size_t index;
    double worth;
  };
  std::vector<Unseen> unseen;
  for (std::size_t i = 0; i < state.landmarks.size(); ++i) {
    const Landmark& landmark = state.landmarks[i];
    if (is_followed(state, landmark.id)) continue;
    unseen.push_back({i, landmark.uses - 10.0 * landmark.misses -
                             0.02 * static_cast<double>(state.frame - landmark.last_frame)});
  }
  std::ranges::stable_sort(unseen, {}, &Unseen::worth);
  std::vector<std::size_t> leaving;
  while (state.landmarks.size() - leaving.size() + wanted > most &&
         leaving.size() < unseen.size()) {
    const std::size_t index = unseen[leaving.size()].index;
    if (state.landmarks[index].misses < kMostMisses) {
      add_map_point(state, setup, map_point_of(state, index));
    }
    leaving.push_back(index);
  }
  std::ranges::sort(leaving);
  remove_landmarks(state, leaving);
  return std::min(wanted, most - std::min(most, state.landmarks.size()));
}

MapChange correct_map(State& state, const Setup& setup, const BetterMap& better) {
  MapChange change;
  if (better.points.empty()) return change;
  std::unordered_map<std::int64_t, std::size_t> map;
  for (std::size_t i = 0; i < state.map.size(); ++i) map.emplace(state.map[i].id, i);
  std::unordered_set<std::int64_t> elsewhere;
  for (const Landmark& landmark : state.landmarks) elsewhere.insert(landmark.id);
  for (const Track& track : state.tracks) elsewhere.insert(track.id);
  std::vector<MapPoint> added;
  for (MapPoint point : better.points) {
    if (elsewhere.contains(point.id)) continue;
    if (!place(state, better.in_map, point)) {
      ++change.refused;
      continue;
    }
    const auto old = map.find(point.id);
    if (old == map.end()) {
      added.push_back(point);
      continue;
    }
    MapPoint& mine = state.map[old->second];
    const Eigen::Vector3d off = point.position - mine.position;
    if (point.milestone >= 0) change_milestone(state, point, mine.milestone);
    const Eigen::Matrix3d both =
        point.covariance +
        (point.milestone >= 0 ? shared_covariance(mine) : world_covariance(state, mine));
    if (off.dot(both.ldlt().solve(off)) > kGate * chi_square_95(3)) {
      ++change.refused;
      continue;
    }
    intersect(mine, point);
    ++change.replaced;
  }
  for (MapPoint& point : added) {
    if (point.milestone < 0) point.milestone = nearest_milestone(state, point.seen_from);
    add_map_point(state, setup, point);
  }
  change.added = static_cast<int>(added.size());
  return change;
}

}  // namespace pirt::slam
