// Something that happens once, and that some wait for, for as long as they like.
#pragma once

#include <cstdint>

#include "scheduler/runtime/threads.h"
#include "workloads/base/time.h"

namespace pirt::runtime {

/// std::latch without a limit of time is all that C++20 has. Who sets it wakes only if somebody
/// waits.
class Latch {
 public:
  [[nodiscard]] bool is_set() const { return state_.load(std::memory_order_acquire) == kSet; }
  /// exchange(state) -> load acquire of is_set: who sees it set sees what was written before.
  void set() {
    if (state_.exchange(kSet) == kAwaited) futex_wake(state_, INT32_MAX);
  }
  /// Nobody waits, and nobody will before this has become known to them.
  void reset() { state_.store(kNot, std::memory_order_relaxed); }
  void wait() {
    while (!is_set()) sleep(Nanos::max());
  }
  /// @return  Whether it is set.
  bool wait_for(Nanos most) {
    const LiveClock clock;
    const Nanos until = later_by(clock.now(), most);
    while (!is_set()) {
      const Nanos now = clock.now();
      if (now >= until) return false;
      sleep(until - now);
    }
    return true;
  }

 private:
  enum : std::uint32_t { kNot, kAwaited, kSet };

  void sleep(Nanos most) {
    std::uint32_t state = kNot;
    if (state_.compare_exchange_strong(state, kAwaited) || state == kAwaited) {
      futex_wait(state_, kAwaited, most);
    }
  }
  FutexWord state_ = kNot;
};

}  // namespace pirt::runtime
