// PEFT, predict earliest finish time.
//
//   OCT(i, u) = max over successors j of min over units v of
//               (OCT(j, v) + cost(j, v) + (v == u ? 0 : mean transfer(i, j)))
//   rank(i)   = mean over units of OCT(i, u)
//   for each ready task, by falling rank: on the unit with the smallest finish + OCT, with
//   insertion
//
// Source: Arabnejad, Barbosa: List Scheduling Algorithm for Heterogeneous Systems by an Optimistic
// Cost Table, IEEE TPDS 25(3), 2014. Reading: units that cannot run a task take no part in its row.
#include <algorithm>

#include "scheduler/planner/planner.h"

namespace pirt {
namespace {

/// [task][unit]; only meant where the unit runs the task.
std::vector<std::vector<Nanos>> optimistic_costs(const PlanningGraph& graph) {
  std::vector<std::vector<Nanos>> table(graph.tasks(),
                                        std::vector<Nanos>(graph.units(), Nanos::zero()));
  for (auto it = graph.order().rbegin(); it != graph.order().rend(); ++it) {
    for (UnitId unit = 0; unit < graph.units(); ++unit) {
      for (const std::size_t e : graph.out(*it)) {
        const std::size_t successor = graph.edge(e).to;
        Nanos best = Nanos::max();
        for (const UnitId other : graph.units_of(successor)) {
          const Nanos moved = other == unit ? Nanos::zero() : graph.mean_transfer(e);
          best = std::min(best, table[successor][other] + graph.cost(successor, other) + moved);
        }
        table[*it][unit] = std::max(table[*it][unit], best);
      }
    }
  }
  return table;
}

std::vector<Nanos> ranks_of(const PlanningGraph& graph,
                            const std::vector<std::vector<Nanos>>& table) {
  std::vector<Nanos> ranks;
  for (std::size_t task = 0; task < graph.tasks(); ++task) {
    const auto& units = graph.units_of(task);
    Nanos sum{0};
    for (const UnitId unit : units) sum += table[task][unit];
    ranks.push_back(sum / static_cast<Nanos::rep>(units.size()));
  }
  return ranks;
}

Plan plan_peft(const PlanningGraph& graph) {
  const auto table = optimistic_costs(graph);
  const auto on_best = [&](const PlanBuilder& builder, std::size_t task) {
    return builder.best_unit(task, table[task]);
  };
  return plan_by_priority(graph, ranks_of(graph, table), on_best);
}

}  // namespace

constinit const PlannerInfo planner::peft = {
    .name = "peft",
    .description =
        "Static plan, predict earliest finish time: looks ahead by an optimistic cost table",
    .plan = plan_peft};

}  // namespace pirt
