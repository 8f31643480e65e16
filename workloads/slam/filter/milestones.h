// Past poses that stay in the filter, so that a place that is seen again corrects all that was
// drifted through since: the way back there, and with it the robot.
//
// What the map's points were off by when they left the filter, they were off by together with the
// poses that they were seen from. A point is therefore known against a milestone near which it was
// seen, as well as those few metres tell, and the filter knows how milestone and robot are off
// together. Points move with their milestones.
#pragma once

#include "workloads/slam/filter/filter.h"

namespace pirt::slam {

/// The oldest clone that tracks are seen from goes. It becomes a milestone if there is none near
/// it; if there are too many by that, the milestone goes that is nearest to another one.
/// @param depth  Median of what is seen, which says what near is.
void leave_window(State& state, const Setup& setup, double depth);

/// A landmark as a point of the map, against the milestone nearest to where it was described.
[[nodiscard]] MapPoint map_point_of(const State& state, std::size_t landmark);

/// Frame of the milestone nearest to a place; -1 = there is none.
[[nodiscard]] std::int64_t nearest_milestone(const State& state, const Eigen::Vector3d& place);

/// What a point with a milestone is off by in the world, of the milestone's errors. f64 [3,6]
[[nodiscard]] JacobianPart moves_with(const State& state, const MapPoint& point);

/// The milestone of a frame; null = it has gone.
[[nodiscard]] const Clone* find_milestone(const State& state, std::int64_t milestone);

/// A point that has a milestone is known against another one from now on, or against the world
/// (-1), less well by what the one is off by against the other.
void change_milestone(const State& state, MapPoint& point, std::int64_t milestone);

/// What a point of the map is off by against its milestone: more than it says, since points that
/// were seen together are off together. f64 [3,3]
[[nodiscard]] Eigen::Matrix3d shared_covariance(const MapPoint& point);

/// What a point of the map is off by in the world: the same, and as its milestone is. f64 [3,3]
[[nodiscard]] Eigen::Matrix3d world_covariance(const State& state, const MapPoint& point);

/// A landmark of a point that has a milestone, known as shared_covariance() says.
[[nodiscard]] NewLandmark landmark_of(const State& state, const MapPoint& point);

/// All milestones go; their points are known against the world from now on.
void forget_milestones(State& state);

}  // namespace pirt::slam
