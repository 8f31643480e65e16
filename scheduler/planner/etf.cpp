// ETF, earliest time first.
//
//   while tasks are left: of all pairs of a ready task and a unit, the one that can start first;
//   ties: the task with the higher static level (the longest way to the end, without transfers)
//
// Source: Hwang, Chow, Anger, Lee: Scheduling Precedence Graphs in Systems with Interprocessor
// Communication Times, SIAM J. Computing 18(2), 1989; there units are alike. Readings for units
// that are not: static levels are of mean costs; among units where a task starts at the same time,
// the fastest.
#include <optional>
#include <tuple>

#include "scheduler/planner/planner.h"

namespace pirt {
namespace {

Plan plan_etf(const PlanningGraph& graph) {
  const auto levels = graph.upward_ranks(false);
  // Start; level, negated, so that the highest is the least; cost; then the first task and unit.
  using Pair = std::tuple<Nanos, Nanos, Nanos, std::size_t, UnitId>;
  PlanBuilder builder(graph);
  while (!builder.ready().empty()) {
    std::optional<Pair> best;
    for (const std::size_t task : builder.ready()) {
      for (const UnitId unit : graph.units_of(task)) {
        const Pair pair(builder.append_start(task, unit), -levels[task], graph.cost(task, unit),
                        task, unit);
        if (!best || pair < *best) best = pair;
      }
    }
    const auto [start, level, cost, task, unit] = *best;
    builder.place(task, unit, start);
  }
  return std::move(builder).finish();
}

}  // namespace

constinit const PlannerInfo planner::etf = {
    .name = "etf",
    .description = "Static plan, earliest time first: of ready tasks the one that can start first",
    .plan = plan_etf};

}  // namespace pirt
