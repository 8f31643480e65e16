// Following points from picture to picture as workloads of the robot's own: slam's tracker, which
// takes guesses, in a call.
#pragma once

#include <vector>

#include "scheduler/runtime/runtime.h"
#include "workloads/slam/filter/state.h"

namespace pirt {

/// On units of backend cpu, with pictures of @p setup's sizes; L = a pyramid's levels (slam/
/// step_tensors.h), n = slam::most_tracks(setup):
/// - "pyramid", and "pyramid_right" where there are two cameras: picture u8 [h,w] -> L.
/// - "track": L of the picture before, L of this one, points f32 [<=n,2], guesses f32 [<=n,2] ->
///   tracks f32 [<=n,2], found u8 [<=n].
/// - "track_right", likewise: L of the left picture, L of the right one, tracks and found of
///   "track", depths f64 [<=n] (metres, 0 = unknown) -> tracks, found.
[[nodiscard]] std::vector<OwnWorkload> tracking_workloads(const slam::Setup& setup);

}  // namespace pirt
