// How long a firing can take at most in mode budget, by response-time analysis: a guarantee, where
// it is no longer than the deadline.
//
// It holds for calls that take no longer than the plan's worst times, on units that serve their
// tasks alone: one at a time, in the order of budget.cpp, and suspended for more urgent ones at the
// ends of slices at most. Each task with a deadline is looked at on the unit that the plan gives
// it; where that is a cloud, it has to be back before the robot wants it back (services/recall.h).
//
// @source George, Rivierre, Spuri: Preemptive and Non-Preemptive Real-Time UniProcessor Scheduling,
// INRIA RR-2966, 1996 (a task's response by its place in a busy period, blocking included);
// Tindell, Clark: Holistic schedulability analysis for distributed hard real-time systems, 1994 (a
// predecessor's response is the jitter of what comes after it). What a unit is left idle for what
// is foreseen is this project's.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "scheduler/planner/budget_plan.h"
#include "scheduler/services/scenario.h"

namespace pirt {

struct Guarantee {
  bool analysed = false;
  /// From the firing to its end, never more; absent: not analysed, or there is no limit.
  std::optional<Nanos> response = {};
  std::string not_analysed = {};  ///< Why.
};

/// Sets how long what has no rate or no deadline may hold a unit for which guaranteed tasks of the
/// plan may wait, so that no guarantee is lost by it (BudgetPlan::Task::tolerates). Such a unit
/// serves one call at a time from then on.
/// @param plan           Nobody has set that before.
/// @param one_at_a_time  Else units that serve several calls at a time are left as they are.
/// @return  Whether one of these units served several calls at a time.
bool protect(const Scenario& scenario, BudgetPlan& plan, bool one_at_a_time = true);

/// Image buffers that the pipeline has at a time: of as many firings as come while one is under
/// way, if none is late, or of one frame of a closed loop, and what a later firing may take.
[[nodiscard]] std::int64_t image_buffers_of(const Pipeline& pipeline);

/// By pipeline; of those with a rate and a deadline. The others have no reason why not.
[[nodiscard]] std::vector<Guarantee> guarantees_of(const Scenario& scenario,
                                                   const BudgetPlan& plan);

}  // namespace pirt
