// A map whose place is known: its points, and the run's own outside of the filter, as measurements.
#pragma once

#include "workloads/slam/filter/steps.h"

namespace pirt::slam {

/// Points of the known map and of the run's own that should be in view, are found within their
/// uncertainty and pass their gate become landmarks, and correct the state with their covariance.
/// The run's own only where it has drifted since: what they say was once taken from the same state.
void use_map(State& state, const Setup& setup, const Features& features, FrameReport& report);

/// Makes a point a landmark's worth: which of the known map has gone into the filter.
[[nodiscard]] bool is_taken(const State& state, std::size_t known_point);
void take(State& state, std::size_t known_point);

}  // namespace pirt::slam
