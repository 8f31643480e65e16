// CPOP, critical path on a processor.
//
//   priority(i) = rank_u(i) + rank_d(i)
//   the critical path: from an entry task along successors whose priority is the entry's
//   its unit: the one on which the whole path costs least
//   for each ready task, by falling priority: on the path -> that unit, otherwise -> the unit where
//   it finishes first; both with insertion
//
// Source: Topcuoglu, Hariri, Wu, IEEE TPDS 13(3), 2002. Readings: of several entry tasks the one
// with the highest priority begins the path (as under a pseudo entry task without cost); where no
// unit can run the whole path, the unit that can run most of it is taken, and the rest of the path
// goes where it finishes first.
#include <algorithm>
#include <optional>
#include <tuple>

#include "scheduler/planner/planner.h"

namespace pirt {
namespace {

/// By task: whether it is on the path.
std::vector<bool> critical_path(const PlanningGraph& graph, const std::vector<Nanos>& priorities) {
  std::optional<std::size_t> at;
  for (const std::size_t task : graph.order()) {
    if (graph.in(task).empty() && (!at || priorities[task] > priorities[*at])) at = task;
  }
  std::vector<bool> on_path(graph.tasks(), false);
  const Nanos length = priorities[*at];
  while (at) {
    on_path[*at] = true;
    const auto& out = graph.out(*at);
    const auto next = std::ranges::find_if(
        out, [&](std::size_t e) { return priorities[graph.edge(e).to] == length; });
    at = next == out.end() ? std::nullopt : std::optional(graph.edge(*next).to);
  }
  return on_path;
}

UnitId path_unit(const PlanningGraph& graph, const std::vector<bool>& on_path) {
  std::tuple<std::size_t, Nanos, UnitId> best;
  for (UnitId unit = 0; unit < graph.units(); ++unit) {
    std::size_t not_run = 0;
    Nanos cost{0};
    for (std::size_t task = 0; task < graph.tasks(); ++task) {
      if (!on_path[task]) continue;
      if (graph.runs(task, unit)) {
        cost += graph.cost(task, unit);
      } else {
        ++not_run;
      }
    }
    const std::tuple candidate(not_run, cost, unit);
    best = unit == 0 ? candidate : std::min(best, candidate);
  }
  return std::get<UnitId>(best);
}

Plan plan_cpop(const PlanningGraph& graph) {
  auto priorities = graph.upward_ranks();
  const auto downward = graph.downward_ranks();
  for (std::size_t task = 0; task < graph.tasks(); ++task) priorities[task] += downward[task];
  const auto on_path = critical_path(graph, priorities);
  const UnitId critical = path_unit(graph, on_path);
  return plan_by_priority(graph, priorities, [&](const PlanBuilder& builder, std::size_t task) {
    const bool pinned = on_path[task] && graph.runs(task, critical);
    return pinned ? critical : builder.best_unit(task);
  });
}

}  // namespace

constinit const PlannerInfo planner::cpop = {
    .name = "cpop",
    .description = "Static plan, critical path on a processor: the longest path stays on one unit",
    .plan = plan_cpop};

}  // namespace pirt
