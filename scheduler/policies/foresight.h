// What is going to need a unit, by when: tasks that were submitted and not placed, and the next
// firings of pipelines that fire at a rate. Of pipelines with a deadline only.
//
// It knows what a policy hears: the tasks as they are submitted, placed and gone, and the plan. A
// firing that does not come within its jitter is taken for dropped; a pipeline of which two in a
// row did not come, for one that has ended.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "scheduler/planner/budget_plan.h"
#include "workloads/base/time.h"

namespace pirt {

class Foresight {
 public:
  /// @param plan  Must outlive it; in time its tasks may get other units.
  explicit Foresight(const BudgetPlan& plan);

  void submitted(const Task& task);
  /// A task of the entry waits again. @param deadline  Of its firing; Nanos::max() = none.
  void came_back(std::uint32_t entry, Nanos deadline);
  /// One that waited waits no more.
  void left(std::uint32_t entry, Nanos deadline);
  /// By when the most urgent waiting task of the entry has to end; Nanos::max() = nobody says.
  [[nodiscard]] Nanos latest_end(std::uint32_t entry) const;

  /// A refusal, and when it may be worth asking again if nothing else happens.
  struct Conflict {
    Nanos ask_again{0};
  };
  /// Whether the most urgent task of the entry, started on the unit now, would make something more
  /// urgent late that needs the unit: then it had better wait. Absent = no, or it cannot wait
  /// either.
  /// @param up  Units that are up.
  [[nodiscard]] std::optional<Conflict> conflict(std::uint32_t entry, UnitId unit, UnitMask up,
                                                 Nanos now);

 private:
  struct Demand {
    Nanos latest_end{0};
    Nanos ready{0};
    Nanos takes{0};
  };
  struct Stream {
    std::int64_t next = 0;  ///< Number of the firing that comes next.
    std::vector<std::uint32_t> entries;
  };

  [[nodiscard]] UnitId unit_of(std::uint32_t entry, UnitMask up) const;
  void skip_missing(std::size_t pipeline, Nanos now);
  Nanos foresee(std::size_t pipeline, UnitId unit, UnitMask up, Nanos now, Nanos until);
  void add_waiting(std::uint32_t asking, UnitId unit, UnitMask up, Nanos now);

  const BudgetPlan& plan_;
  std::vector<std::deque<Nanos>> waiting_;  ///< By entry: deadlines of firings, rising.
  std::vector<bool> is_urgent_;             ///< By entry: some task of it had a deadline,
  std::vector<std::uint32_t> urgent_;       ///< and those entries.
  std::vector<Stream> streams_;             ///< By pipeline.
  std::vector<std::int64_t> missed_;        ///< By pipeline: firings in a row that did not come.
  std::vector<Demand> demands_;             ///< Of conflict; kept for its memory.
};

}  // namespace pirt
