// Who has nothing to do sleeps until somebody rings; who rings enters the system only where
// somebody sleeps.
#pragma once

#include <cstdint>

#include "scheduler/runtime/futex.h"

namespace pirt::runtime {

/// Any number of threads on both sides.
class Bell {
 public:
  /// Sleeps until @p there is something.
  /// @param there  bool(): reads atomics, in the one order of all (seq_cst); whoever makes it true
  ///               writes them so, and rings afterwards. Then either this sees it before it sleeps,
  ///               or who rings sees that somebody sleeps.
  template <typename There>
  void sleep_until(const There& there) {
    asleep_.fetch_add(1);
    while (true) {
      const std::uint32_t rung = rung_.load();
      if (there()) break;
      futex_wait(rung_, rung);
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
  std::atomic<std::uint32_t> asleep_ = 0;  ///< Or about to be.
};

}  // namespace pirt::runtime
