// The plan of mode budget in a trace.
#pragma once

#include "scheduler/planner/budget_plan.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// Null for an empty plan.
[[nodiscard]] Json to_json(const BudgetPlan& plan);
/// The same back.
/// @throws JsonError for a missing key or a wrong type, Error{kBadInput} for what fits no platform
/// of @p units units.
[[nodiscard]] BudgetPlan budget_plan_from_json(const Json& json, std::size_t units);

}  // namespace pirt
