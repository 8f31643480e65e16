// Which unit serves how much of each task, by a linear programme: where a budget begins.
#pragma once

#include <optional>

#include "scheduler/bounds/bounds.h"
#include "scheduler/planner/budget_plan.h"
#include "scheduler/policies/setup.h"

namespace pirt {

struct Goals {
  Objective objective = Objective::kRate;
  std::optional<double> min_rate_per_ms = {};
  std::optional<double> most_w = {};  ///< Above what is drawn idle.
};

/// Sets the units of the plan's tasks, and which may have none: pipelines with a deadline at their
/// rate where that fits, then the most tasks (rate, latency) or as many as are wanted (energy),
/// then the least energy for that. Nothing where no rate above 0 keeps the goals.
void assign(const Work& work, const Goals& goals, BudgetPlan& plan);

}  // namespace pirt
