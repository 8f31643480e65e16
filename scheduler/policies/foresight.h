// What is going to need a unit, by when: tasks that were submitted and not placed, and the next
// firings of pipelines that fire at a rate. Of pipelines with a deadline only.
//
// It knows what a policy hears: the tasks as they are submitted, placed and gone, and the plan. A
// firing that does not come within its jitter is taken for dropped; a pipeline of which two in a
// row did not come, for one that has ended.
//
// Two things keep a task from a unit. Nothing that is more urgent shall become late for it: what
// is foreseen is gone through by deadline, as far as the task's call makes a difference, and gets
// the time that what is more urgent leaves, as if all calls could be suspended. And what has no
// rate or no deadline shall hold the unit no longer than guarantees count on
// (BudgetPlan::Task::tolerates).
#pragma once

#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "scheduler/planner/budget_plan.h"
#include "workloads/base/time.h"

namespace pirt {

class Foresight {
 public:
  /// @param plan     Must outlive it; in time its tasks may get other units.
  /// @param servers  By unit; empty = one each.
  explicit Foresight(const BudgetPlan& plan, std::vector<int> servers = {});

  void submitted(const Task& task);
  /// A task of the entry waits again. @param deadline  Of its firing; Nanos::max() = none.
  void came_back(std::uint32_t entry, Nanos deadline);
  /// One that waited waits no more.
  void departed(std::uint32_t entry, Nanos deadline);
  /// By when the most urgent waiting task of the entry has to end; Nanos::max() = nobody says.
  [[nodiscard]] Nanos latest_end(std::uint32_t entry) const;

  /// Whether the most urgent task of the entry, started on the unit now, would make something more
  /// urgent late that needs the unit: then it had better wait. Absent = no, or it cannot wait
  /// either. @return  When it may be worth asking again if nothing else happens.
  [[nodiscard]] std::optional<Nanos> conflict(std::uint32_t entry, UnitId unit, Nanos now);
  /// Other units are up, or the plan is another one.
  /// @param up  Units that are up; before the first call all.
  void find_units(UnitMask up);

 private:
  /// What a task needs of the unit, one firing after the other.
  struct Demand {
    Nanos latest_end{0};  ///< Of its time on the unit.
    Nanos ready{0};
    std::uint32_t entry = 0;
    std::size_t place = 0;  ///< Among those that wait and then those that come.
  };
  using Span = std::pair<Nanos, Nanos>;  ///< From when until when.
  /// When a unit serves demands, the more urgent one first.
  struct Timeline {
    Nanos free{0};           ///< It has nothing to do from then on,
    std::vector<Span> idle;  ///< and in these times before that, rising.
    Span serve(Nanos ready, Nanos needs);
  };
  struct Stream {
    std::int64_t next = 0;    ///< Number of the firing that comes next.
    std::int64_t missed = 0;  ///< Firings in a row that did not come.
  };

  [[nodiscard]] UnitId unit_of(std::uint32_t entry) const;
  void skip_missing(std::size_t pipeline, Nanos now);
  [[nodiscard]] bool comes(std::size_t pipeline) const {
    return plan_.pipelines[pipeline].is_periodic() && streams_[pipeline].missed < kEnded;
  }
  [[nodiscard]] Nanos nominal(std::size_t pipeline, std::int64_t number) const;
  [[nodiscard]] Nanos missing(std::size_t pipeline) const;
  [[nodiscard]] int calls_at_once(const BudgetPlan::Task& task, UnitId unit) const;
  [[nodiscard]] Nanos elsewhere(const BudgetPlan::Task& task, UnitId unit) const;
  [[nodiscard]] std::optional<Demand> demand(std::uint32_t entry, UnitId unit, std::size_t place,
                                             Nanos now) const;
  Nanos first_demands(std::uint32_t entry, UnitId unit, Nanos now, Nanos ends);
  [[nodiscard]] std::optional<Nanos> breaks_guarantee(const BudgetPlan::Task& asking, UnitId unit,
                                                      Nanos now) const;
  [[nodiscard]] std::optional<Nanos> coming(std::size_t pipeline, std::size_t place,
                                            Nanos now) const;
  [[nodiscard]] Nanos needed_beside(std::uint32_t entry, UnitId unit, Nanos now, Nanos until) const;

  static constexpr std::int64_t kEnded = 2;  ///< Firings in a row that did not come.

  const BudgetPlan& plan_;
  std::vector<int> servers_;
  UnitMask up_ = ~UnitMask{0};
  std::vector<std::deque<Nanos>> waiting_;      ///< By entry: deadlines of firings, rising.
  std::vector<bool> is_urgent_;                 ///< By entry: some task of it had a deadline.
  std::vector<UnitMask> eligible_;              ///< By entry: of the last such task; before, all.
  std::vector<std::vector<std::uint32_t>> on_;  ///< By unit: those of these that it serves.
  std::vector<Stream> streams_;                 ///< By pipeline.
  std::vector<Demand> demands_;                 ///< Of conflict, kept for their memory: it,
  Timeline without_, behind_;                   ///< and the unit without the task and behind it.
};

}  // namespace pirt
