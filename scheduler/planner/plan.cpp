#include "scheduler/planner/plan.h"

#include <algorithm>
#include <cassert>

namespace pirt {

PlanBuilder::PlanBuilder(const PlanningGraph& graph) : graph_(graph) {
  plan_.tasks.resize(graph.tasks());
  plan_.order.resize(graph.units());
  for (std::size_t task = 0; task < graph.tasks(); ++task) {
    pending_.push_back(graph.in(task).size());
    if (pending_.back() == 0) ready_.push_back(task);
  }
}

Nanos PlanBuilder::data_ready(std::size_t task, UnitId unit) const {
  Nanos ready{0};
  for (const std::size_t e : graph_.in(task)) {
    const GraphEdge& edge = graph_.edge(e);
    const PlannedTask& from = plan_.tasks[edge.from];
    ready = std::max(ready, from.finish + edge.transfer(from.unit, unit));
  }
  return ready;
}

Nanos PlanBuilder::earliest_start(std::size_t task, UnitId unit) const {
  Nanos start = data_ready(task, unit);
  const auto& order = plan_.order[unit];
  // What has finished by then is in nobody's way.
  auto placed = std::ranges::upper_bound(
      order, start, {}, [this](std::size_t each) { return plan_.tasks[each].finish; });
  for (; placed != order.end(); ++placed) {
    if (start + graph_.cost(task, unit) <= plan_.tasks[*placed].start) break;
    start = std::max(start, plan_.tasks[*placed].finish);
  }
  return start;
}

Nanos PlanBuilder::append_start(std::size_t task, UnitId unit) const {
  const auto& order = plan_.order[unit];
  const Nanos idle = order.empty() ? Nanos::zero() : plan_.tasks[order.back()].finish;
  return std::max(idle, data_ready(task, unit));
}

UnitId PlanBuilder::best_unit(std::size_t task, const std::vector<Nanos>& tail) const {
  std::optional<UnitId> best;
  Nanos best_value{0};
  for (const UnitId unit : graph_.units_of(task)) {
    const Nanos value = earliest_start(task, unit) + graph_.cost(task, unit) +
                        (tail.empty() ? Nanos::zero() : tail[unit]);
    if (best && value >= best_value) continue;
    best = unit;
    best_value = value;
  }
  assert(best && "a planning graph has a unit for each task");
  return *best;
}

void PlanBuilder::place(std::size_t task, UnitId unit, Nanos start) {
  const Nanos finish = start + graph_.cost(task, unit);
  plan_.tasks[task] = {unit, start, finish};
  plan_.makespan = std::max(plan_.makespan, finish);
  auto& order = plan_.order[unit];
  const auto later = std::ranges::upper_bound(
      order, start, {}, [this](std::size_t each) { return plan_.tasks[each].start; });
  order.insert(later, task);
  ready_.erase(std::ranges::lower_bound(ready_, task));
  for (const std::size_t e : graph_.out(task)) {
    const std::size_t successor = graph_.edge(e).to;
    if (--pending_[successor] == 0) {
      ready_.insert(std::ranges::lower_bound(ready_, successor), successor);
    }
  }
}

}  // namespace pirt
