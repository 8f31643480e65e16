// What can be had of a platform and a mix: mode budget with several goals, beside other modes.
#pragma once

#include <string>
#include <vector>

#include "scheduler/schedule.h"

namespace pirt {

/// The given modes, then mode budget for the rate, for latency, for energy, for the least energy at
/// rates between the slowest and the fastest of these, and with fewer and more frames in flight:
/// the last two of a mix of closed loops that fires more than once.
/// @param options  Its mode, objective and least rate are not looked at.
[[nodiscard]] ModeRuns run_frontier(const Platform& platform, const Profile* profile,
                                    const Mix& mix, const std::vector<std::string>& modes,
                                    const ScheduleOptions& options);

/// "budget, energy, at least 0.465 tasks/ms"; of other modes the mode.
[[nodiscard]] std::string goal_of(const RunRecord& run);

}  // namespace pirt
