#include "scheduler/planner/planner.h"

namespace pirt {

std::span<const PlannerInfo* const> planners() {
  static constexpr const PlannerInfo* all[] = {
#define PIRT_PLANNER(name) &planner::name,
#include "scheduler/planner/planners.inc"
#undef PIRT_PLANNER
  };
  return all;
}

}  // namespace pirt
