// The weights of Algorithms 1 to 3: given by the user or the platform file, or derived from service
// times.
//
// The paper says no more than that they come from "the coarse-grain profiling result of each
// workload"; the rules here are pirt's.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "scheduler/policies/policy.h"
#include "scheduler/services/services.h"

namespace pirt {

/// @param rule  Not kOfBasic.
/// @return      [workload][unit]; 0 for units that do not serve the workload and for the cloud,
/// which no basic algorithm uses.
///
/// kShare (Algorithm 1): shares in proportion to 1/s, s the service time, as the whole numbers of
/// sum at most 9 that come closest (least sum of squared differences of shares; the smaller sum of
/// two that are equal). The `else` of the algorithm counts as one more for the unit it names. No
/// unit is below 1 unless its share is below 1/20.
///
/// kQueue (Algorithm 3): W = ceil(servers * s / b), b the longest stage on the unit itself: by
/// Little's law what keeps the unit busy. One more for a unit with one slot, so that one task
/// waits. kFastQueue (Algorithm 2): the same, but 0 for a unit whose rate, servers / b, is below a
/// tenth of the fastest one's.
[[nodiscard]] WeightTable derive_weights(WeightRule rule, const Platform& platform,
                                         const ServiceTable& services);

/// The same weights for every workload; units that are not named get 0.
/// @param source  For messages: "--weights" or "modes.latency.weights".
/// @throws Error{kBadInput} for a negative weight, a name that is no unit, a unit of the cloud, or
/// if all are 0.
[[nodiscard]] WeightTable given_weights(const std::map<std::string, int>& weights,
                                        const Platform& platform, const ServiceTable& services,
                                        const std::string& source);

/// Frames in flight that keep every unit busy that may serve the tasks: the sum of kQueue's
/// weights.
[[nodiscard]] int in_flight_for(const TaskClass& kind, const Platform& platform,
                                const ServiceTable& services);

}  // namespace pirt
