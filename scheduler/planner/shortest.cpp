// The shortest plan that the static planners find: each wins on some graphs, and planning is cheap.
#include <utility>

#include "scheduler/planner/planner.h"

namespace pirt {

Plan plan_shortest(const PlanningGraph& graph) {
  Plan best = plan_heft(graph);
  for (const Planner planner : {&plan_cpop, &plan_peft, &plan_etf}) {
    Plan plan = planner(graph);
    if (plan.makespan < best.makespan) best = std::move(plan);
  }
  return best;
}

}  // namespace pirt
