// What mode budget decides before a run, and what it foresees in it: data that its policy follows
// (policies/budget.cpp) and budget/ improves.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "scheduler/mix/task.h"
#include "scheduler/services/scenario.h"
#include "workloads/base/time.h"

namespace pirt {

struct BudgetPlan {
  struct Task {
    std::uint32_t pipeline = 0;
    bool first = false;         ///< Of its pipeline: that it is submitted tells of a firing.
    bool pinned = false;        ///< It keeps the first of `units` that is up.
    std::vector<UnitId> units;  ///< That may serve it, the best first.
    std::vector<int> capacity;  ///< By unit: it is given the task while it has fewer. 0 = never,
                                ///< unless no other is up.
    std::vector<double> share;  ///< By unit: it gets at most this part of the task's calls.
    std::vector<Nanos> worst;   ///< By unit: how long a call holds a slot there when it takes long,
                                ///< data on its way included.
    std::vector<std::uint32_t> context;  ///< By unit: the program that it runs for the task.
    std::vector<Nanos> prepare;    ///< By unit: what it adds where another program was before.
    std::vector<double> window_j;  ///< By unit: the most that a call draws in a second, above idle.
    Nanos behind{0};               ///< The longest way from its end to that of its firing.
    /// By unit: of such a call the longest time until it ends or can be suspended; empty = it
    /// cannot be anywhere.
    std::vector<Nanos> slice = {};
    /// Of a task that guarantees count on, on the first of its units: from its firing, it is ready
    /// after `ready` at most, and calls of what has no rate or no deadline may hold the unit for
    /// `tolerates` beyond that. Absent: nobody counts on it.
    Nanos ready{0};
    std::optional<Nanos> tolerates = {};
    std::optional<std::size_t> state = {};  ///< That one task holds at a time, in order.
    /// By unit: so many of its calls are served at a time by the links and other units' servers
    /// that they need; what its own serve is in capacity. Empty = any number.
    std::vector<int> at_once = {};
    [[nodiscard]] Nanos slice_on(UnitId unit) const {
      return slice.empty() ? worst[unit] : slice[unit];
    }
    /// Until a call with a program that it has to load ends or can be suspended.
    [[nodiscard]] Nanos holds(UnitId unit) const { return slice_on(unit) + prepare[unit]; }
    [[nodiscard]] bool can_be_suspended(UnitId unit) const { return slice_on(unit) < worst[unit]; }
    /// A call with a program that it has to load.
    [[nodiscard]] Nanos takes(UnitId unit) const { return worst[unit] + prepare[unit]; }
    /// The longest way from its start, on the first of its units, to the end of its firing.
    [[nodiscard]] Nanos way() const { return takes(units.front()) + behind; }
    friend bool operator==(const Task&, const Task&) = default;
  };
  /// When a pipeline fires: at offset + n / rate and up to `jitter` later.
  struct Arrivals {
    std::optional<double> rate_hz = {};  ///< Absent: nobody knows.
    Nanos offset{0};
    Nanos jitter{0};
    std::optional<Nanos> deadline = {};
    bool real_time = true;
    /// Its firings are known beforehand, and have to end in time.
    [[nodiscard]] bool is_periodic() const { return rate_hz && deadline; }
    friend bool operator==(const Arrivals&, const Arrivals&) = default;
  };
  std::vector<Task> tasks;  ///< Of all pipelines; the position is TaskClass::entry.
  std::vector<Arrivals> pipelines;
  std::optional<double> window_j;  ///< What all may draw in any second, above idle; absent = all.
  friend bool operator==(const BudgetPlan&, const BudgetPlan&) = default;
};

/// A unit that one of the plan's tasks may go to, and nobody knows what that draws; null = none.
[[nodiscard]] const UnitModel* without_joules(const Scenario& scenario, const BudgetPlan& plan);

/// Joules in a second that a cap leaves above what all units draw idle; below 0: infeasible.
[[nodiscard]] double above_idle_j(const Platform& platform, double power_cap_w);
/// What to say of such a cap.
[[nodiscard]] std::string infeasible_cap(const Platform& platform, double power_cap_w);

/// A plan that nobody has improved: the cheapest unit first, tasks with a deadline on one unit,
/// queues no longer than what keeps a unit busy.
/// @param scenario  Its classes have their entries.
/// @throws Error{kBadInput} for a cap where nobody knows what a unit that may serve a task draws.
[[nodiscard]] BudgetPlan first_budget_plan(const Scenario& scenario,
                                           std::optional<double> power_cap_w);

/// Sets what follows from the first of each task's units: the ways behind them.
void measure_ways(const Scenario& scenario, BudgetPlan& plan);

}  // namespace pirt
