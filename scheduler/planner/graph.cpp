#include "scheduler/planner/graph.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "scheduler/mix/dependency_order.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

Nanos rounded_mean(const std::vector<Nanos>& values) {
  Nanos::rep sum = 0;
  for (const Nanos value : values) sum += value.count();
  const auto count = static_cast<Nanos::rep>(values.size());
  return Nanos(count == 0 ? 0 : (sum + count / 2) / count);
}

bool any_negative(const std::vector<Nanos>& values) {
  return std::ranges::any_of(values, [](Nanos value) { return value < Nanos::zero(); });
}

}  // namespace

PlanningGraph::PlanningGraph(TaskGraph graph) : graph_(std::move(graph)) {
  check();
  in_.resize(tasks());
  out_.resize(tasks());
  std::vector<std::vector<std::size_t>> predecessors(tasks());
  for (std::size_t e = 0; e < graph_.edges.size(); ++e) {
    in_[edge(e).to].push_back(e);
    out_[edge(e).from].push_back(e);
    predecessors[edge(e).to].push_back(edge(e).from);
  }
  auto sorted = dependency_order(predecessors);
  if (!sorted.cycle.empty()) {
    throw_bad_input("task graph: " + cycle_text(sorted.cycle, graph_.names));
  }
  order_ = std::move(sorted.order);
  average();
}

void PlanningGraph::check() const {
  if (graph_.costs.empty()) throw_bad_input("task graph: it has no task");
  if (graph_.names.size() != graph_.costs.size()) {
    throw_bad_input("task graph: it has not one name and one row of costs a task");
  }
  const std::size_t unit_count = graph_.costs.front().size();
  for (std::size_t task = 0; task < tasks(); ++task) {
    const auto& row = graph_.costs[task];
    const std::string& name = graph_.names[task];
    if (row.size() != unit_count || unit_count == 0 || unit_count > kMaxUnits) {
      throw_bad_input("task graph: " + name + " has costs for " + std::to_string(row.size()) +
                      " units; all tasks have one for each of 1 to " + std::to_string(kMaxUnits));
    }
    if (std::ranges::any_of(row, [](Nanos cost) { return cost < Nanos(1); })) {
      throw_bad_input("task graph: " + name + " has a cost below 1 ns");
    }
    if (std::ranges::all_of(row, [](Nanos cost) { return cost == kUnsupported; })) {
      throw_bad_input("task graph: no unit can run " + name);
    }
  }
  for (const auto& edge : graph_.edges) {
    if (edge.from >= tasks() || edge.to >= tasks()) {
      throw_bad_input("task graph: an edge names task " +
                      std::to_string(std::max(edge.from, edge.to)) + " of " +
                      std::to_string(tasks()));
    }
    assert((edge.leave.empty() || edge.leave.size() == unit_count) &&
           (edge.enter.empty() || edge.enter.size() == unit_count));
    if (edge.delay < Nanos::zero() || any_negative(edge.leave) || any_negative(edge.enter)) {
      throw_bad_input("task graph: the transfer from " + graph_.names[edge.from] + " to " +
                      graph_.names[edge.to] + " takes less than 0");
    }
  }
}

void PlanningGraph::average() {
  for (std::size_t task = 0; task < tasks(); ++task) {
    auto& able = units_.emplace_back();
    std::vector<Nanos> costs;
    for (UnitId unit = 0; unit < units(); ++unit) {
      if (!runs(task, unit)) continue;
      able.push_back(unit);
      costs.push_back(cost(task, unit));
    }
    mean_cost_.push_back(rounded_mean(costs));
  }
  for (const auto& edge : graph_.edges) {
    // Each unit is source, and target, of equally many pairs.
    const Nanos mean = edge.delay + rounded_mean(edge.leave) + rounded_mean(edge.enter);
    mean_transfer_.push_back(units() == 1 ? Nanos::zero() : mean);
  }
}

std::vector<Nanos> PlanningGraph::upward_ranks(bool transfers) const {
  std::vector<Nanos> ranks(tasks(), Nanos::zero());
  for (auto task = order_.rbegin(); task != order_.rend(); ++task) {
    for (const std::size_t e : out_[*task]) {
      const Nanos moving = transfers ? mean_transfer(e) : Nanos::zero();
      ranks[*task] = std::max(ranks[*task], moving + ranks[edge(e).to]);
    }
    ranks[*task] += mean_cost_[*task];
  }
  return ranks;
}

std::vector<Nanos> PlanningGraph::downward_ranks() const {
  std::vector<Nanos> ranks(tasks(), Nanos::zero());
  for (const std::size_t task : order_) {
    for (const std::size_t e : in_[task]) {
      const std::size_t from = edge(e).from;
      ranks[task] = std::max(ranks[task], ranks[from] + mean_cost_[from] + mean_transfer(e));
    }
  }
  return ranks;
}

}  // namespace pirt
