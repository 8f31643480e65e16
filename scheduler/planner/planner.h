// The static planners: pure functions from a task graph to a plan, one file each in this folder. A
// new one is such a file and its line in planners.inc.
#pragma once

#include <span>
#include <string_view>

#include "scheduler/planner/plan.h"

namespace pirt {

using Planner = Plan (*)(const PlanningGraph& graph);

struct PlannerInfo {
  std::string_view name;
  std::string_view description;
  Planner plan;
};

namespace planner {
#define PIRT_PLANNER(name) extern const PlannerInfo name;
#include "scheduler/planner/planners.inc"
#undef PIRT_PLANNER
}  // namespace planner

[[nodiscard]] inline std::span<const PlannerInfo* const> planners() {
  static constexpr const PlannerInfo* all[] = {
#define PIRT_PLANNER(name) &planner::name,
#include "scheduler/planner/planners.inc"
#undef PIRT_PLANNER
  };
  return all;
}

}  // namespace pirt
