// A static schedule of a task graph, and how the planners build one up.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
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

  /// When the task could start on the unit: its data is there, and the unit is idle for as long as
  /// it takes, also between tasks that are placed already (insertion). Only if the unit runs it.
  [[nodiscard]] Nanos earliest_start(std::size_t task, UnitId unit) const;
  /// When it could start after all that is on the unit, without insertion.
  [[nodiscard]] Nanos append_start(std::size_t task, UnitId unit) const;
  /// The unit where it would finish first, @p tail included; ties: the first.
  /// @param tail  By unit; empty = 0.
  [[nodiscard]] UnitId best_unit(std::size_t task, const std::vector<Nanos>& tail = {}) const;

  /// @param start  Of earliest_start or append_start.
  void place(std::size_t task, UnitId unit, Nanos start);
  [[nodiscard]] Plan finish() &&;

 private:
  [[nodiscard]] Nanos data_ready(std::size_t task, UnitId unit) const;

  const PlanningGraph& graph_;
  Plan plan_;
};

/// Tasks whose predecessors are all taken, as list schedulers work through them.
class ReadyList {
 public:
  explicit ReadyList(const PlanningGraph& graph);
  [[nodiscard]] const std::vector<std::size_t>& tasks() const { return ready_; }
  [[nodiscard]] bool empty() const { return ready_.empty(); }
  /// Takes @p task out; those that only waited for it are ready.
  void take(std::size_t task);
  /// Takes the one with the highest of @p priorities (by task); ties: the first of the graph.
  template <typename Priority>
  std::size_t take_highest(const std::vector<Priority>& priorities) {
    const std::size_t task =
        *std::ranges::max_element(ready_, {}, [&](std::size_t each) { return priorities[each]; });
    take(task);
    return task;
  }

 private:
  const PlanningGraph& graph_;
  std::vector<std::size_t> pending_;
  std::vector<std::size_t> ready_;  ///< In the graph's order.
};

}  // namespace pirt
