// HEFT, heterogeneous earliest finish time.
//
//   rank_u(i) = mean cost(i) + max over successors j of (mean transfer(i, j) + rank_u(j))
//   for each task, by falling rank_u: on the unit where it finishes first, with insertion
//
// Source: Topcuoglu, Hariri, Wu: Performance-Effective and Low-Complexity Task Scheduling for
// Heterogeneous Computing, IEEE TPDS 13(3), 2002. Ties, which the paper breaks at random, go to the
// task that is first in the graph, and to the first unit.
#include <algorithm>

#include "scheduler/planner/planner.h"

namespace pirt {

namespace {

Plan plan_heft(const PlanningGraph& graph) {
  const auto ranks = graph.upward_ranks();
  // Costs are above 0, so that a predecessor's rank is above its successors'.
  auto order = graph.order();
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return ranks[a] > ranks[b]; });
  PlanBuilder builder(graph);
  for (const std::size_t task : order) {
    const UnitId unit = builder.best_unit(task);
    builder.place(task, unit, builder.earliest_start(task, unit));
  }
  return std::move(builder).finish();
}

}  // namespace

constinit const PlannerInfo planner::heft = {
    .name = "heft",
    .description =
        "Static plan, heterogeneous earliest finish time: by upward rank, with insertion",
    .plan = plan_heft};

}  // namespace pirt
