// A plan that a search has made shorter than those of the static planners.
#pragma once

#include "scheduler/planner/plan.h"

namespace pirt {

/// Begins with the shortest plan of all planners and tries other orders of tasks: some are drawn
/// earlier or later, or onto another unit; what is not longer is kept. So many tries that a graph
/// of 40 tasks takes some tens of milliseconds; the same graph gives the same plan.
[[nodiscard]] Plan shortened_plan(const PlanningGraph& graph);

}  // namespace pirt
