// Plans a run of mode budget: capacities of queues, a unit for each task with a deadline, and
// frames in flight. A linear programme says where to begin; virtual time what it comes to.
#pragma once

#include <vector>

#include "scheduler/planner/budget_plan.h"
#include "scheduler/planner/mix_plan.h"
#include "scheduler/policies/setup.h"
#include "scheduler/record/run_record.h"

namespace pirt {

/// What is chosen beforehand: a plan, or a mode that plans nothing.
struct BudgetChoice {
  BudgetPlan plan;
  std::vector<int> in_flight;           ///< By pipeline; 0 for open loops.
  const PolicyInfo* follows = nullptr;  ///< In place of the plan.
  friend bool operator==(const BudgetChoice&, const BudgetChoice&) = default;
};

/// What mode budget follows.
struct PlannedBudget {
  BudgetChoice choice;
  std::vector<TriedPlan> tried = {};  ///< It and what it was compared with.
  MixPlan plan = {};                  ///< In place of the choice, if it has entries.
};

/// Plans for each objective, with frames in flight that nobody gave, and runs these plans, and
/// modes edf and ect, in virtual time, some thousand tasks each, or until the first deadlines have
/// passed, with the mix's jitter and a seed of its own: what has the fewest late firings of
/// real-time pipelines, then the fewest queued ones, and of those the best by the objective. So
/// much is tried as takes some tens of milliseconds, more where the first deadlines are late; the
/// same inputs give the same.
/// @param setup  Of mode budget, without a static plan.
[[nodiscard]] PlannedBudget plan_budget(const ModeSetup& setup, const ScheduleOptions& options);
/// The same for a mix that fires once: a static plan, compared with nothing, unless that misses
/// deadlines and plan_budget's choice fewer; of large graphs always, as trials take their square.
[[nodiscard]] PlannedBudget plan_once(const ModeSetup& setup, const ScheduleOptions& options);
/// @p setup follows it, with its policy made anew.
void follow(const PlannedBudget& planned, ModeSetup& setup);

/// Adds a plan for each unit that may go away (PolicySetup::budget_without), and makes the policy
/// of @p setup anew: for live runs, where units do. Frames in flight stay what they are. Nothing
/// for a mix that fires once.
/// @param setup  That follows what was planned.
void plan_for_losses(ModeSetup& setup, const ScheduleOptions& options);

}  // namespace pirt
