// How long a call may take before its unit is taken for one that hangs, and how often who waits
// looks.
#pragma once

#include <algorithm>

#include "scheduler/services/services.h"
#include "workloads/base/time.h"
#include "workloads/model/own_operation.h"

namespace pirt {

/// Whether to stop, at calls that run, whether what is elsewhere is within reach.
inline constexpr Nanos kLookEvery = std::chrono::milliseconds(50);

/// A busy machine, a kernel's first call.
inline constexpr Nanos kLeastTimeLimit = std::chrono::seconds(5);

/// Of a function of the robot's own of which nobody says what it takes.
inline constexpr Nanos kUnknownTimeLimit = std::chrono::seconds(10);

/// @param longest  What a call takes at most where nothing is wrong, with preparing.
[[nodiscard]] inline Nanos time_limit(Nanos longest, Nanos least = kLeastTimeLimit) {
  constexpr int kTimes = 50;
  return std::max(least, kTimes * longest);
}

/// @param service    What the call is expected to take.
/// @param own_clock  The unit tells time by a clock of its own: how long this machine takes for a
///                   call does not follow from that.
/// @param workload   That is called.
[[nodiscard]] inline Nanos time_limit(const Service& service, bool own_clock,
                                      const Workload& workload) {
  // Its own clock may be that of an emulator.
  Nanos least = own_clock ? std::chrono::seconds(60) : kLeastTimeLimit;
  // Who kills its program when that is late says more of it, and goes on.
  const OwnOperation* const own = own_operation(workload);
  if (own != nullptr) least = std::max(least, own->ends_by_itself + kLeastTimeLimit);
  const Nanos longest = scaled(service.total(), service.spread.high);
  return time_limit(longest + service.prepare.value_or(Nanos::zero()), least);
}

}  // namespace pirt
