// Something that happens once, and that some wait for, for as long as they like.
#pragma once

#include <cstdint>
#include <ctime>

#include "scheduler/runtime/futex.h"
#include "workloads/base/time.h"

namespace pirt::runtime {

/// std::latch without a limit of time is all that C++20 has. Who sets it wakes only if somebody
/// waits.
class Latch {
 public:
  [[nodiscard]] bool is_set() const { return state_.load(std::memory_order_acquire) == kSet; }
  void set() {
    if (state_.exchange(kSet) == kAwaited) futex_wake(state_, INT32_MAX);
  }
  /// Nobody waits, and nobody will before this has become known to them.
  void reset() { state_.store(kNot, std::memory_order_relaxed); }
  void wait() {
    while (!is_set()) sleep(nullptr);
  }
  /// @return  Whether it is set.
  template <typename Clock>
  bool wait_for(Nanos most, const Clock& clock) {
    const Nanos begin = clock.now();
    while (!is_set()) {
      const Nanos remaining = most - (clock.now() - begin);
      if (remaining <= Nanos::zero()) return false;
      const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(remaining);
      const std::timespec time{.tv_sec = seconds.count(), .tv_nsec = (remaining - seconds).count()};
      sleep(&time);
    }
    return true;
  }

 private:
  enum : std::uint32_t { kNot, kAwaited, kSet };

  void sleep(const std::timespec* most) {
    std::uint32_t state = kNot;
    if (state_.compare_exchange_strong(state, kAwaited) || state == kAwaited) {
      futex_wait(state_, kAwaited, most);
    }
  }
  FutexWord state_ = kNot;
};

}  // namespace pirt::runtime
