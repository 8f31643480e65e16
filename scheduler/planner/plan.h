// A static schedule of a task graph, and how the planners build one up.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "scheduler/planner/graph.h"

namespace pirt {

struct PlannedTask {
  UnitId unit = 0;
  Nanos start{0};
  Nanos finish{0};
  friend bool operator==(const PlannedTask&, const PlannedTask&) = default;
};

struct Plan {
  std::vector<PlannedTask> tasks;               ///< By task of the graph.
  std::vector<std::vector<std::size_t>> order;  ///< By unit: its tasks, by planned start.
  Nanos makespan{0};                            ///< The last finish; the first task starts at 0.
  friend bool operator==(const Plan&, const Plan&) = default;
};

/// Places tasks one after the other, each after its predecessors. Keeps a reference to the graph.
class PlanBuilder {
 public:
  explicit PlanBuilder(const PlanningGraph& graph);

  /// Tasks that are not placed, and whose predecessors all are, in the graph's order.
  [[nodiscard]] const std::vector<std::size_t>& ready() const { return ready_; }
  /// When the task could start on the unit: its data is there, and the unit is idle for as long as
  /// it takes, also between tasks that are placed already (insertion). Only if the unit runs it.
  [[nodiscard]] Nanos earliest_start(std::size_t task, UnitId unit) const;
  /// When it could start after all that is on the unit, without insertion.
  [[nodiscard]] Nanos append_start(std::size_t task, UnitId unit) const;
  /// The unit where it would finish first, @p tail included; ties: the first.
  /// @param tail  By unit; empty = 0.
  [[nodiscard]] UnitId best_unit(std::size_t task, const std::vector<Nanos>& tail = {}) const;

  /// @param task   Of ready().
  /// @param start  Of earliest_start or append_start.
  void place(std::size_t task, UnitId unit, Nanos start);
  [[nodiscard]] Plan finish() && { return std::move(plan_); }

 private:
  [[nodiscard]] Nanos data_ready(std::size_t task, UnitId unit) const;

  const PlanningGraph& graph_;
  Plan plan_;
  std::vector<std::size_t> pending_;  ///< By task: edges from predecessors that are not placed.
  std::vector<std::size_t> ready_;
};

/// Places ready tasks by falling priority, with insertion; ties: the first of the graph.
/// @param priorities  By task.
/// @param unit_of     UnitId(const PlanBuilder&, std::size_t task): where it goes.
template <typename Priority, typename UnitOf>
[[nodiscard]] Plan plan_by_priority(const PlanningGraph& graph,
                                    const std::vector<Priority>& priorities,
                                    const UnitOf& unit_of) {
  PlanBuilder builder(graph);
  while (!builder.ready().empty()) {
    const std::size_t task = *std::ranges::max_element(
        builder.ready(), {}, [&](std::size_t each) { return priorities[each]; });
    const UnitId unit = unit_of(builder, task);
    builder.place(task, unit, builder.earliest_start(task, unit));
  }
  return std::move(builder).finish();
}

}  // namespace pirt
