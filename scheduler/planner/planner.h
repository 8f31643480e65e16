// The static planners: pure functions from a task graph to a plan, one file each in this folder.
#pragma once

#include "scheduler/planner/plan.h"

namespace pirt {

using Planner = Plan (*)(const PlanningGraph& graph);

[[nodiscard]] Plan plan_heft(const PlanningGraph& graph);
[[nodiscard]] Plan plan_cpop(const PlanningGraph& graph);
[[nodiscard]] Plan plan_peft(const PlanningGraph& graph);
[[nodiscard]] Plan plan_etf(const PlanningGraph& graph);
/// The shortest of the four above; ties: the first in that order.
[[nodiscard]] Plan plan_shortest(const PlanningGraph& graph);

}  // namespace pirt
