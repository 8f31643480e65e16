// The run's own points outside of the filter: kept, and corrected by somebody who looks at a whole
// stretch of the way.
#pragma once

#include <vector>

#include "workloads/slam/filter/state.h"

namespace pirt::slam {

/// Where there are too many, the milestone with the most points loses the one that was seen longest
/// ago.
void add_map_point(State& state, const Setup& setup, const MapPoint& point);

/// Whether a track follows it.
[[nodiscard]] bool is_followed(const State& state, std::int64_t landmark);

/// Makes room for @p wanted landmarks: those that were not found again where they should be, else
/// those that were used least, among those that are not seen, become points of the map.
/// @return  For how many there is room.
std::size_t make_room(State& state, const Setup& setup, std::size_t wanted);

/// A landmark that was not found so often where it should be seen is not what it was.
inline constexpr int kMostMisses = 8;

/// Points as somebody knows them who has looked at more than the last pictures.
struct BetterMap {
  /// Those that have a milestone are in its body's axes: while somebody looked, it may have moved,
  /// and they go with it. The others are of the world.
  std::vector<MapPoint> points;
  bool in_map = false;  ///< Of the setup's known map's world; otherwise of that of the start.
};

/// What became of them.
struct MapChange {
  int replaced = 0;
  int added = 0;  ///< Of tracks that were no landmarks.
  /// Farther from where the map has them than both covariances say, or of a milestone that went.
  int refused = 0;
};

/// Points of bundle adjustment take the place of those of the map that have their id. Both come
/// from the same pictures, so that what they say together is their covariance intersection; the
/// pose is as it was, and use_map() gates what the points say of it. What is in the filter is left
/// to the filter, and what is still being followed to the steps that follow it.
/// @source  Julier and Uhlmann, A non-divergent estimation algorithm in the presence of unknown
/// correlations, ACC 1997.
MapChange correct_map(State& state, const Setup& setup, const BetterMap& better);

}  // namespace pirt::slam
