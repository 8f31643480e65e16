// What it takes to suspend a call between two slices and to resume it: row `leave` of a profile.
#pragma once

#include <vector>

#include "workloads/base/time.h"

namespace pirt {

/// Lets a call that computes nothing into another one between two slices, with all that a runtime
/// does for it: submission, dispatcher, queue and end.
/// @param cores  The unit's, on which its thread runs; empty = all.
/// @return  @p samples times, each from the end of a slice until the call that was suspended goes
/// on.
/// @throws Error{kEnvironment} if the thread cannot be started, or not run there.
[[nodiscard]] std::vector<Nanos> measure_leave(const std::vector<int>& cores, int samples);

}  // namespace pirt
