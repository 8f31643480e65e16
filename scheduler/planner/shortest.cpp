// The shortest plan that the static planners find: each wins on some graphs, and planning is cheap.
#include <optional>
#include <utility>

#include "scheduler/planner/planner.h"

namespace pirt {

namespace {

Plan plan_shortest(const PlanningGraph& graph) {
  std::optional<Plan> best;
  for (const PlannerInfo* planner : planners()) {
    if (planner == &planner::shortest) continue;
    Plan plan = planner->plan(graph);
    if (!best || plan.makespan < best->makespan) best = std::move(plan);
  }
  return *std::move(best);
}

}  // namespace

constinit const PlannerInfo planner::shortest = {
    .name = "shortest",
    .description = "Static plan: the shortest of those of all other planners",
    .plan = plan_shortest};

}  // namespace pirt
