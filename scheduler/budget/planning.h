// Plans a run of mode budget: capacities of queues, a unit for each task with a deadline, and
// frames in flight. A linear programme says where to begin; virtual time what it comes to.
#pragma once

#include "scheduler/policies/setup.h"

namespace pirt {

/// Makes the plan of @p setup better, with frames in flight that nobody gave, and its policy anew.
/// So much is tried as takes some tens of milliseconds; the same inputs give the same plan. A mix
/// that fires once gets a static plan.
/// @param setup  Of mode budget.
void plan_budget(ModeSetup& setup, const ScheduleOptions& options);

/// Adds a plan for each unit that may go away (PolicySetup::budget_without), and makes the policy
/// of @p setup anew: for live runs, where units do. Frames in flight stay what they are. Nothing
/// for a mix that fires once.
/// @param setup  Of plan_budget.
void plan_for_losses(ModeSetup& setup, const ScheduleOptions& options);

}  // namespace pirt
