// What lengthens calls in virtual time beyond their steady rows: handing them over, caches that
// others filled meanwhile, and units of the same memory. The model: ../README.md.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "scheduler/mix/task.h"
#include "scheduler/services/scenario.h"
#include "scheduler/virtual/firings.h"
#include "workloads/base/time.h"

namespace pirt {

class CallEffects {
 public:
  /// @param scenario  Must outlive it.
  explicit CallEffects(const Scenario& scenario);

  /// Whether anything is known of them; what follows is for where it is.
  [[nodiscard]] bool any() const { return !units_.empty(); }
  /// A task starts on the unit. @param random  Evenly spread over 64 bits, here and below.
  /// @return  What passes until its call begins.
  [[nodiscard]] Nanos handed_over(UnitId unit, Nanos now, std::uint64_t random);

  /// `execute` on a unit.
  struct Execution {
    JobIndex job = 0;
    UnitId unit = 0;
    WorkloadId workload = 0;
    Nanos steady{0};  ///< What it takes with steady caches, stretched by `scale`.
    const CallConditions* conditions = nullptr;
    double scale = 1;  ///< Of the stage, by which its cold rows are stretched as well.
  };
  /// Another call that it slows.
  struct Slowed {
    JobIndex job = 0;
    UnitId unit = 0;
    Nanos by{0};
  };
  /// It begins; its conditions are known.
  /// @return  How long it takes if nothing more begins beside it.
  [[nodiscard]] Nanos executes(const Execution& execution, Nanos now, std::uint64_t random);

  /// The rest of a call that is suspended between two slices, while it is.
  struct Rest {
    Execution executing;
    Nanos takes{0};  ///< Beside what ran when it began,
    Nanos alone{0};  ///< and beside nothing.
  };
  /// The call on the unit, whose conditions are known, is suspended.
  [[nodiscard]] Rest suspend(UnitId unit, Nanos now);
  struct Resumed {
    Nanos passes{0};  ///< Until it goes on.
    double part = 1;  ///< What the rest takes beside what runs now, of Rest::takes.
  };
  /// It goes on.
  /// @param rest  Rest{} = its conditions are not known.
  [[nodiscard]] Resumed resume(UnitId unit, const Rest& rest, Nanos now, std::uint64_t random);
  /// Calls of other units that the last call which began, or went on, slows.
  [[nodiscard]] const std::vector<Slowed>& slowed() const { return slowed_; }

  /// The task has ended on the unit.
  void ended(UnitId unit, WorkloadId workload, JobIndex job, Nanos now);

 private:
  /// When a workload's last call on a unit had executed, and the bytes that had been touched by
  /// then.
  struct Touched {
    Nanos at{0};
    std::int64_t by_unit = 0;
    std::int64_t by_all = 0;  ///< Units of the same memory.
  };
  struct Unit {
    int tasks = 0;  ///< That are on it.
    Nanos idle_since{0};
    std::int64_t touched = 0;                  ///< Bytes, by all calls so far.
    std::vector<std::optional<Touched>> last;  ///< By workload; absent = there was none.
    Execution executing;                       ///< The last that began,
    Nanos ends{0};                             ///< when it does,
    double stretch = 1;                        ///< how many times as long others made the rest,
    Nanos room{0};                             ///< by how much others may still slow it,
    bool noted = true;                         ///< and whether what it touched is counted.
  };
  void run(const Execution& execution, Nanos alone, Nanos now);
  void note_touched(UnitId id, Nanos now);
  [[nodiscard]] std::int64_t touched_beside(UnitId id) const;

  const Scenario& scenario_;
  std::vector<Unit> units_;  ///< Empty where nothing is known of any.
  std::vector<Slowed> slowed_;
};

}  // namespace pirt
