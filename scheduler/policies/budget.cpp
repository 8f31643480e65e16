// Mode budget: meets deadlines, and beside them what it was asked for, under a cap of power.
//
// The plan (../planner/budget_plan.h, made better by ../budget/) says which units serve a task, in
// which order, and how many tasks a unit may have when it is given one more. Here is what is
// decided as things come:
//
//   the task that has to start first (its deadline less the longest way to the end of its firing)
//   goes before others; those of real-time pipelines without a deadline come next, then the rest;
//   a task with a deadline keeps the unit that the plan gives it while that is up;
//   a unit stays idle rather than begin what would make late a more urgent task that waits for it
//   or is foreseen (foresight.h), unless what asks would be late then itself;
//   what has no deadline waits while it would break the cap of power (power_window.h); what has one
//   does not, and is counted;
//   where two units do, a unit that holds the task's program goes before one that has to load it;
//   while a unit is away, the plan is the one that was made for that.
//
// Where a mode that plans nothing does better in a trial (../budget/planning.h), it decides.
// With no plan from budget/, as in a runtime that knows no mix, the cheapest unit that has room
// serves a task. A mix that fires once follows a static plan (planned.cpp).
#include <algorithm>
#include <numeric>
#include <optional>

#include "scheduler/policies/foresight.h"
#include "scheduler/policies/policies.h"
#include "scheduler/policies/power_window.h"

namespace pirt {
namespace {

// Ranks of tasks without a deadline, behind all times that a run reaches.
constexpr Nanos kRealTime = Nanos::max() - Nanos(1);
constexpr Nanos kRest = Nanos::max();

class BudgetPolicy final : public Policy {
 public:
  explicit BudgetPolicy(const PolicySetup& setup)
      : whole_(setup.budget),
        without_(setup.budget_without),
        plan_(whole_),
        servers_(setup.servers),
        cloud_(units_where(setup.roles, [](Role role) { return role == Role::kCloud; })),
        foresight_(plan_, servers_),
        calls_(plan_.tasks.size(), std::vector<std::int64_t>(setup.servers.size(), 0)),
        holds_(setup.servers.size()) {
    if (plan_.window_j) window_.emplace(*plan_.window_j);
  }

  Nanos rank(const Task& task) override {
    foresight_.submitted(task);
    if (!task.deadline) return task.kind.real_time ? kRealTime : kRest;
    // Whoever is away, so that ranks of one entry compare.
    return *task.deadline - whole_.tasks[task.kind.entry].way();
  }

  void units_changed(UnitMask up) override {
    UnitId away = 0;
    while (away < without_.size() && (contains(up, away) || without_[away].tasks.empty())) ++away;
    plan_ = away < without_.size() ? without_[away] : whole_;
    foresight_.find_units(up);
  }

  Placement place(const TaskClass& task, const UnitsView& units) override {
    if (units.now >= ask_again_) ask_again_ = Nanos::max();
    const auto unit = choose(task, units);
    return unit ? Placement::on(*unit) : Placement::hold();
  }

  void moved(const MovedTask& task, Whereabouts from, Whereabouts to,
             const UnitsView& units) override {
    const std::uint32_t entry = task.kind.entry;
    if (from.waits()) foresight_.departed(entry, task.deadline);
    if (to.waits()) foresight_.came_back(entry, task.deadline);
    if (to.is_placed()) note_placed(entry, to.unit, units.now);
    if (from.is_placed() && window_) {
      window_->ended(plan_.tasks[entry].window_j[from.unit], units.now);
    }
  }

  UnitMask takers(const TaskClass& task, UnitMask up) const override {
    UnitMask mask = 0;
    for (const UnitId unit : plan_.tasks[task.entry].units) mask |= unit_bit(unit);
    if (task.real_time) mask &= ~cloud_;
    return mask & task.eligible & up;
  }

  [[nodiscard]] Nanos ask_again() const override { return ask_again_; }
  [[nodiscard]] std::int64_t over_cap() const override { return over_cap_; }

 private:
  void note_placed(std::uint32_t entry, UnitId unit, Nanos now) {
    const BudgetPlan::Task& planned = plan_.tasks[entry];
    ++calls_[entry][unit];
    holds_[unit] = planned.context[unit];
    if (!window_) return;
    if (!window_->allows(planned.window_j[unit], now)) ++over_cap_;
    window_->started(planned.window_j[unit]);
  }

  /// Whether the unit may have one more of the task's calls; it may while all units are idle, whose
  /// tasks would change that.
  bool has_share(const TaskClass& task, UnitId unit, const UnitsView& units) const {
    const double share = plan_.tasks[task.entry].share[unit];
    if (share >= 1 || std::ranges::all_of(units.load, [](int load) { return load == 0; })) {
      return true;
    }
    const auto& calls = calls_[task.entry];
    const std::int64_t all = std::reduce(calls.begin(), calls.end());
    return static_cast<double>(calls[unit] + 1) <= share * static_cast<double>(all + 1) + 1;
  }

  /// Nothing speaks against starting the task there now, except what is said of capacities.
  /// @param capacity  So many of the task's calls the unit may have.
  bool may_start(const TaskClass& task, UnitId unit, int capacity, const UnitsView& units) {
    const BudgetPlan::Task& planned = plan_.tasks[task.entry];
    if (units.load[unit] + 1 >= std::min(servers_[unit], capacity)) {  // The last one at a time.
      if (const auto again = foresight_.conflict(task.entry, unit, units.now)) {
        wait_until(*again, units.now);
        return false;
      }
    }
    const bool urgent = plan_.pipelines[planned.pipeline].deadline.has_value();
    if (urgent || !window_ || window_->allows(planned.window_j[unit], units.now)) return true;
    wait_until(window_->next(), units.now);
    return false;
  }

  void wait_until(Nanos time, Nanos now) {
    if (time > now) ask_again_ = std::min(ask_again_, time);
  }

  bool is_warm(const TaskClass& task, UnitId unit) const {
    const BudgetPlan::Task& planned = plan_.tasks[task.entry];
    return planned.prepare[unit] == Nanos::zero() || holds_[unit] == planned.context[unit];
  }

  std::optional<UnitId> choose(const TaskClass& task, const UnitsView& units) {
    const BudgetPlan::Task& planned = plan_.tasks[task.entry];
    const UnitMask mask = task.eligible & units.up;
    // Units that the plan leaves out serve where no other can.
    const bool any_planned = std::ranges::any_of(planned.units, [&](UnitId unit) {
      return contains(mask, unit) && planned.capacity[unit] > 0;
    });
    std::optional<UnitId> cold;
    for (const UnitId unit : planned.units) {
      if (!contains(mask, unit)) continue;
      const int capacity = any_planned ? planned.capacity[unit] : servers_[unit];
      const bool has_room = units.load[unit] < capacity;
      if (has_room && has_share(task, unit, units) && may_start(task, unit, capacity, units)) {
        if (is_warm(task, unit)) {
          return cold && planned.worst[unit] > planned.takes(*cold) ? cold : unit;
        }
        if (!cold) cold = unit;
      }
      if (planned.pinned) break;
    }
    return cold;
  }

  BudgetPlan whole_;                 ///< With all units,
  std::vector<BudgetPlan> without_;  ///< without one of them, by unit,
  BudgetPlan plan_;                  ///< and what holds now.
  std::vector<int> servers_;
  UnitMask cloud_;
  Foresight foresight_;
  std::optional<PowerWindow> window_;
  std::vector<std::vector<std::int64_t>> calls_;     ///< [entry][unit]: placed so far.
  std::vector<std::optional<std::uint32_t>> holds_;  ///< By unit: the program of what it was given.
  Nanos ask_again_ = Nanos::max();
  std::int64_t over_cap_ = 0;
};

}  // namespace

constinit const PolicyInfo policy::budget = {
    .name = "budget",
    .description =
        "Meets deadlines under --power-cap, then gives what --objective says; foresees firings",
    .make = [](const PolicySetup& setup) -> std::unique_ptr<Policy> {
      if (!setup.plan.entries.empty()) return make_planned_policy(setup);
      if (setup.follows != nullptr) return setup.follows->make(setup);
      return std::make_unique<BudgetPolicy>(setup);
    },
    .cloud_use = CloudUse::kNotRealTime,
    .budgets = true,
    .without_joules = "plans for deadlines and rate or latency, whatever its objective",
};

}  // namespace pirt
