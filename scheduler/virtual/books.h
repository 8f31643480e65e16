// What a run has served and spent at units and links. A copy may be closed while the run goes on.
#pragma once

#include "scheduler/mix/task.h"
#include "scheduler/record/tally.h"
#include "scheduler/services/call_plan.h"
#include "scheduler/services/scenario.h"
#include "scheduler/virtual/firings.h"
#include "workloads/base/time.h"

namespace pirt {

class Books {
 public:
  /// @param scenario  Must outlive it.
  explicit Books(const Scenario& scenario);

  /// Servers have worked on a step of a task that is on @p unit: those of a unit, which may be
  /// another, or of its link.
  /// @param powered  The part that draws the unit's active_w.
  /// @param own_j    Of the call's own joules.
  void charge(const CallStep& step, UnitId unit, Nanos served, Nanos powered, double own_j) {
    charge_own(unit, own_j);
    if (step.servers < tally_.units.size()) {
      UnitTally& served_by = tally_.units[step.servers];
      served_by.busy += served;
      served_by.powered += powered;
      if (step.prepares) served_by.preparing += served;
    } else {
      charge_link(unit, served);
    }
  }
  /// Joules of a call of the unit beyond busy servers and links.
  void charge_own(UnitId unit, double own_j) { tally_.units[unit].own_j += own_j; }
  void charge_link(UnitId unit, Nanos sending) { tally_.units[unit].transferring += sending; }
  /// A call that is computed has occupied its unit, and drawn its active_w for part of that.
  /// @param own_part  Of its own joules, the part that was served.
  void charge_computed(WorkloadId workload, UnitId unit, Nanos busy, Nanos powered,
                       double own_part);
  void count_prepare(UnitId unit) { ++tally_.units[unit].prepares; }
  /// Of what is computed: the part of what is charged.
  void count_preparing(UnitId unit, Nanos preparing) { tally_.units[unit].preparing += preparing; }
  /// @param call     How long it was on its unit, without preparing.
  /// @param latency  Dispatch to completion.
  void count_completed(WorkloadId workload, UnitId unit, Nanos call, Nanos latency);
  /// A task has ended on its unit, whatever became of it.
  void note_end(Nanos now) { tally_.last_completion = now; }

  [[nodiscard]] Nanos last_completion() const { return tally_.last_completion; }
  /// A meter has told what a call of it takes, which is counted by the call.
  [[nodiscard]] bool is_metered(WorkloadId workload, UnitId unit) const;

  /// Ends them: all of it, as of @p end, with what others counted.
  [[nodiscard]] Tally close(Nanos end, const TaskCounts& tasks, const Firings& firings) &&;

 private:
  const Scenario& scenario_;
  Tally tally_;
};

}  // namespace pirt
