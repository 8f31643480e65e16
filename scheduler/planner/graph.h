// A task graph as static planners see it: what each task costs on each unit, and what its data
// costs to move. No names of workloads, no rates, no devices.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "scheduler/mix/task.h"
#include "scheduler/services/transfers.h"
#include "workloads/base/time.h"

namespace pirt {

/// The cost of a task on a unit that cannot run it.
inline constexpr Nanos kUnsupported = Nanos::max();

/// Units run one task at a time; transfers do not wait for each other (the model of the planners'
/// papers).
struct TaskGraph {
  std::vector<std::string> names;         ///< By task; for messages.
  std::vector<std::vector<Nanos>> costs;  ///< [task][unit], >= 1 ns, or kUnsupported.
  std::vector<GraphEdge> edges;
};

/// A graph that was checked, with what every planner asks of it. Keeps no reference.
class PlanningGraph {
 public:
  /// @throws Error{kBadInput} for no task, rows of different length, a cost below 1 ns, a task that
  /// no unit can run, an edge to a task that there is not, a transfer below 0, or a cycle, which is
  /// printed with its names.
  explicit PlanningGraph(TaskGraph graph);

  [[nodiscard]] std::size_t tasks() const { return graph_.costs.size(); }
  [[nodiscard]] UnitId units() const { return static_cast<UnitId>(graph_.costs.front().size()); }
  [[nodiscard]] bool runs(std::size_t task, UnitId unit) const {
    return graph_.costs[task][unit] != kUnsupported;
  }
  /// That can run it, rising.
  [[nodiscard]] const std::vector<UnitId>& units_of(std::size_t task) const { return units_[task]; }
  /// Only if runs(task, unit).
  [[nodiscard]] Nanos cost(std::size_t task, UnitId unit) const { return graph_.costs[task][unit]; }
  [[nodiscard]] const GraphEdge& edge(std::size_t edge) const { return graph_.edges[edge]; }
  [[nodiscard]] const std::vector<std::size_t>& in(std::size_t task) const { return in_[task]; }
  [[nodiscard]] const std::vector<std::size_t>& out(std::size_t task) const { return out_[task]; }
  /// All tasks, each after its predecessors; otherwise in their own order.
  [[nodiscard]] const std::vector<std::size_t>& order() const { return order_; }

  /// Over all pairs of different units, rounded to a nanosecond; 0 if there is one unit.
  [[nodiscard]] Nanos mean_transfer(std::size_t edge) const { return mean_transfer_[edge]; }

  /// The longest way from the task's start to the end of the graph, in means.
  /// @param transfers  Whether data on their way count.
  /// @source Topcuoglu, Hariri, Wu: Performance-Effective and Low-Complexity Task Scheduling for
  /// Heterogeneous Computing, IEEE TPDS 13(3), 2002, equation 5.
  [[nodiscard]] std::vector<Nanos> upward_ranks(bool transfers = true) const;
  /// The longest way from the beginning of the graph to the task's start; there, equation 7.
  [[nodiscard]] std::vector<Nanos> downward_ranks() const;

 private:
  void check() const;
  void average();

  TaskGraph graph_;
  std::vector<std::vector<std::size_t>> in_;  ///< Edges, by task.
  std::vector<std::vector<std::size_t>> out_;
  std::vector<std::size_t> order_;
  std::vector<std::vector<UnitId>> units_;  ///< By task.
  std::vector<Nanos> mean_cost_;            ///< By task: over the units that can run it, rounded.
  std::vector<Nanos> mean_transfer_;
};

}  // namespace pirt
