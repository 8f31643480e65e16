// The policies by name, one file each in this folder. A new one is such a file and its line in
// policies.inc.
#pragma once

#include "scheduler/planner/planner.h"
#include "scheduler/policies/policy.h"

namespace pirt {

namespace policy {
#define PIRT_POLICY(name) extern const PolicyInfo name;
#include "scheduler/policies/policies.inc"
#undef PIRT_POLICY
}  // namespace policy

/// Follows the static plan of its setup.
[[nodiscard]] std::unique_ptr<Policy> make_planned_policy(const PolicySetup& setup);
/// Follows the plan that the planner makes before the run.
[[nodiscard]] PolicyInfo planned_policy(const PlannerInfo& planner);

}  // namespace pirt
