// What it takes until a call begins that is handed to a unit's thread.
#pragma once

#include <span>
#include <vector>

#include "characterize/profile/unit_phase.h"
#include "workloads/base/time.h"

namespace pirt {

/// 0 (the call is handed over from the end of the one before), 0.1, 1, 10 and 100 ms, fewer of the
/// longer ones, and never less than a row needs (campaign/validity.h): 2.3 s in all.
[[nodiscard]] std::span<const SleepPlan> handover_plans();

/// Hands empty calls to a unit (KernelUnit, its own queue) whose thread runs on @p cores; no device
/// is opened.
/// @param cores  As UnitRequest::cores.
/// @return  As many as asked for: from run() to the beginning of the call, or from the end of the
/// call before.
/// @throws Error{kEnvironment} if the thread cannot be started, or not run there.
[[nodiscard]] std::vector<Nanos> measure_handover(const std::vector<int>& cores,
                                                  const SleepPlan& plan);

}  // namespace pirt
