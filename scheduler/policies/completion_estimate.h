// When a unit is expected to end a task, by the services' mean times and what it was given before.
//
// The dispatcher knows no durations, so policies that ask for them keep this account: for each
// server of a unit when it will be idle. It corrects itself by the load that the dispatcher shows:
// a unit with fewer tasks than servers has an idle one, and what remains to be done on it is no
// less than the work of the tasks that have to wait, and no more than that of all that it was given
// and has not completed, whatever the account says.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "scheduler/policies/baseline.h"

namespace pirt {

/// As a policy it is ect.
class CompletionEstimate : public Baseline {
 public:
  explicit CompletionEstimate(const PolicySetup& setup);

  Placement place(const TaskClass& task, const UnitsView& units) override {
    return on_or_hold(best_unit(task, units));
  }
  void moved(const MovedTask& task, Whereabouts, Whereabouts to, const UnitsView& units) override {
    if (to.is_placed()) add(task.kind, to.unit, units);
  }

  /// Of the units that may serve the task, are up and are no cloud: the one that is expected to end
  /// it first; ties: the first. Absent if there is none.
  [[nodiscard]] std::optional<UnitId> best_unit(const TaskClass& task, const UnitsView& units);
  /// @param unit  One that can serve it.
  [[nodiscard]] Nanos completion(const TaskClass& task, UnitId unit, const UnitsView& units);
  /// Whether the unit has something to gain from one more task now: by Little's law it is busy with
  /// servers x total / occupied of them.
  [[nodiscard]] bool has_room(const TaskClass& task, UnitId unit, const UnitsView& units) const {
    return units.load[unit] < in_service_[task.workload][unit];
  }
  /// The task goes to the unit.
  void add(const TaskClass& task, UnitId unit, const UnitsView& units);

 private:
  /// A unit's account.
  struct Account {
    std::vector<Nanos> idle_at;  ///< By server.
    std::uint64_t given = 0;     ///< Tasks so far,
    std::uint64_t known = 0;     ///< of which so many are taken not to be complete: the last.
    /// The work of all that was given so far, after each of the known ones and before the first, by
    /// their number modulo the size, a power of two.
    std::vector<Nanos> sums = std::vector<Nanos>(4);

    [[nodiscard]] Nanos sum_after(std::uint64_t tasks) const {
      return sums[tasks & (sums.size() - 1)];
    }
    [[nodiscard]] Nanos work_of_last(std::int64_t tasks) const {
      if (tasks <= 0) return Nanos::zero();
      return sum_after(given) -
             sum_after(given - std::min(known, static_cast<std::uint64_t>(tasks)));
    }
    /// @param load  Tasks that were there before it.
    void give(Nanos work, int load);
  };

  /// Before that no task of any class begins on a unit, as long as it has this load and is given
  /// nothing: so units that cannot be the best need not be asked each time.
  struct Earliest {
    Nanos begin{0};
    int load = 0;
  };

  [[nodiscard]] const CallCost& time(const TaskClass& task, UnitId unit) const {
    return *costs_[task.workload][unit];
  }
  [[nodiscard]] Nanos earliest_begin(UnitId unit, const UnitsView& units) const {
    const Earliest& earliest = earliest_[unit];
    return earliest.load == units.load[unit] ? std::max(earliest.begin, units.now) : units.now;
  }
  [[nodiscard]] bool has_idle_server(UnitId unit, const UnitsView& units) const;
  [[nodiscard]] std::optional<Nanos> corrected_idle(const TaskClass& task, UnitId unit,
                                                    const UnitsView& units) const;

  /// By workload and unit: the least number of tasks that keeps all servers busy; more than these
  /// have to wait.
  std::vector<std::vector<std::int64_t>> in_service_;
  std::vector<Account> accounts_;   ///< By unit,
  std::vector<Earliest> earliest_;  ///< and likewise.
  std::vector<Nanos> totals_;       ///< CallCost::total by workload and unit; 0 = none.
};

}  // namespace pirt
