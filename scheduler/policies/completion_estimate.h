// When a unit is expected to end a task, by the services' mean times and what it was given before.
//
// The dispatcher knows no durations, so a policy that asks for them keeps this account: for each
// server of a unit when it will be idle. It corrects itself: a unit with fewer tasks than servers
// has an idle one, whatever the account says.
#pragma once

#include <optional>
#include <vector>

#include "scheduler/policy.h"

namespace pirt {

class CompletionEstimate {
 public:
  explicit CompletionEstimate(const PolicySetup& setup);

  /// Of the units that may serve the task, are up and are no cloud: the one that is expected to end
  /// it first; ties: the first. Absent if there is none.
  [[nodiscard]] std::optional<UnitId> best_unit(const TaskClass& task,
                                                const UnitsView& units) const;
  /// @param unit  One that can serve it.
  [[nodiscard]] Nanos completion(const TaskClass& task, UnitId unit, const UnitsView& units) const;
  /// Whether the unit has something to gain from one more task now: by Little's law it is busy with
  /// servers x total / occupied of them.
  [[nodiscard]] bool has_room(const TaskClass& task, UnitId unit, const UnitsView& units) const;
  /// The task goes to the unit.
  void add(const TaskClass& task, UnitId unit, const UnitsView& units);

 private:
  [[nodiscard]] const ServiceTime& time(const TaskClass& task, UnitId unit) const {
    return *times_[task.workload][unit];
  }
  [[nodiscard]] bool has_idle_server(UnitId unit, const UnitsView& units) const;

  UnitMask local_;
  std::vector<std::vector<std::optional<ServiceTime>>> times_;
  std::vector<std::vector<Nanos>> idle_at_;  ///< [unit][server]
};

}  // namespace pirt
