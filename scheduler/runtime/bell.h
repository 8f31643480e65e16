// Who has nothing to do sleeps until somebody rings; who rings enters the system only where
// somebody sleeps.
#pragma once

#include <cstdint>

#include "scheduler/runtime/threads.h"

namespace pirt::runtime {

/// Any number of threads on both sides.
class Bell {
 public:
  /// Sleeps until @p there is something.
  /// @param there  bool(): reads atomics, which whoever makes it true writes before he rings.
  ///               add(asleep) -> load(those), seq_cst; pairs with store(those) -> load(asleep) of
  ///               ring: either this sees it, or who rings sees that somebody sleeps.
  /// @param at     When it wakes all the same, by LiveClock.
  template <typename There>
  void sleep_until(const There& there, Nanos at = Nanos::max()) {
    asleep_.fetch_add(1);
    while (true) {
      const std::uint32_t rung = rung_.load();
      if (there()) break;
      const Nanos most = at == Nanos::max() ? at : at - LiveClock().now();
      if (most <= Nanos::zero()) break;
      futex_wait(rung_, rung, most);
    }
    asleep_.fetch_sub(1);
  }
  /// @param sleepers  How many are to look.
  void ring(int sleepers) {
    if (asleep_.load() == 0) return;
    rung_.fetch_add(1);
    futex_wake(rung_, sleepers);
  }

 private:
  FutexWord rung_ = 0;
  Atomic<std::uint32_t> asleep_ = 0;  ///< Or about to be.
};

}  // namespace pirt::runtime
