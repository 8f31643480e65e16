// Where a known map lies against the world in which a run began: sought until views agree.
#pragma once

#include "workloads/slam/filter/steps.h"

namespace pirt::slam {

/// Looks at one frame with the known map's points alone. Views that agree where the map is, of
/// enough points of which some tell the map from its mirror image (a wall does not), find it:
/// the state is in the map's world from then on. Does nothing unless the state tracks and seeks.
/// @return  Whether it was found now.
bool seek_map(State& state, const Setup& setup, const Features& features);

/// Points of the known map and of the run's own that should be in view, are found within their
/// uncertainty and pass their gate become landmarks, and correct the state with their covariance.
/// The run's own only where it has drifted since: what they say was once taken from the same state.
void use_map(State& state, const Setup& setup, const Features& features, FrameReport& report);

/// Makes a point a landmark's worth: which of the known map has gone into the filter.
[[nodiscard]] bool is_taken(const State& state, std::size_t known_point);
void take(State& state, std::size_t known_point);

}  // namespace pirt::slam
