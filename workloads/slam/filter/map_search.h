// Where a known map lies against the world in which a run began: sought until views agree.
#pragma once

#include "workloads/slam/filter/steps.h"

namespace pirt::slam {

/// Looks at one frame with the known map's points alone. Views that agree where the map is, of
/// enough points of which some tell the map from its mirror image (a wall does not), find it:
/// the state is in the map's world from then on. Does nothing unless the state tracks and seeks.
/// @return  Whether it was found now.
bool seek_map(State& state, const Setup& setup, const Features& features);

}  // namespace pirt::slam
