// The call that a thread runs, as other threads see it: they may do something about it, or give it
// up, as long as it runs, and never to another that follows it.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <stop_token>

#include "scheduler/runtime/threads.h"
#include "workloads/base/time.h"

namespace pirt {
struct Call;
}

namespace pirt::runtime {

/// begin and end are its thread's, without a lock unless somebody is about to do something; the
/// others any thread's.
class RunningCall {
 public:
  struct Seen {
    Call* call = nullptr;
    Nanos since{0};            ///< By LiveClock.
    std::uint64_t number = 0;  ///< Of this call among all of the thread.
  };

  /// From here on others see it. store(state) -> load(unwanted) of its thread, seq_cst; pairs with
  /// exchange(unwanted) -> load(state) of KernelUnit::request_stop: one of the two sees the other.
  void begin(Call& call, Nanos since) {
    call_.store(&call, std::memory_order_release);
    since_.store(since.count(), std::memory_order_release);
    state_.store(++number_ << kBits | kRuns);
  }
  /// Waits for who is doing something about it.
  /// @return  False if it was given up; no other call may begin then.
  [[nodiscard]] bool end() {
    while (true) {
      std::uint64_t state = number_ << kBits | kRuns;
      if (state_.compare_exchange_strong(state, number_ << kBits | kOver)) return true;
      if ((state & kMask) == kGivenUp) return false;
      const std::lock_guard wait(mutex_);
    }
  }

  /// Absent if none runs.
  [[nodiscard]] std::optional<Seen> seen() const {
    while (true) {
      const std::uint64_t state = state_.load();
      if (!is_under_way(state)) return std::nullopt;
      // What is of a later call was written after this one had ended, which shows below.
      const Seen seen{call_.load(std::memory_order_acquire),
                      Nanos(since_.load(std::memory_order_acquire)), state >> kBits};
      const std::uint64_t now = state_.load(std::memory_order_acquire);
      if (is_under_way(now) && now >> kBits == seen.number) return seen;
    }
  }
  /// Asks it to stop, if it has not ended. @return  Whether that is news.
  bool request_stop(std::uint64_t number) {
    const std::lock_guard lock(mutex_);
    if (!change(number, kHeld)) return false;
    const bool is_news = stop.request_stop();
    state_.store(number << kBits | kRuns);
    return is_news;
  }
  /// Its thread hears of that when it ends. False if it has ended.
  [[nodiscard]] bool give_up(std::uint64_t number) {
    const std::lock_guard lock(mutex_);
    return change(number, kGivenUp);
  }

  /// Its thread's, but within request_stop and once given up; as good as new before each.
  std::stop_source stop;

 private:
  static constexpr int kBits = 2;
  static constexpr std::uint64_t kMask = 3;
  enum : std::uint64_t { kOver, kRuns, kHeld, kGivenUp };

  static bool is_under_way(std::uint64_t state) {
    return (state & kMask) == kRuns || (state & kMask) == kHeld;
  }
  /// Of the call, if it runs. With the mutex.
  bool change(std::uint64_t number, std::uint64_t to) {
    std::uint64_t runs = number << kBits | kRuns;
    return state_.compare_exchange_strong(runs, number << kBits | to);
  }

  Atomic<std::uint64_t> state_ = kOver;  ///< Number of the call, and how it stands.
  Atomic<Call*> call_ = nullptr;
  Atomic<std::int64_t> since_ = 0;
  std::uint64_t number_ = 0;  ///< The thread's.
  Mutex mutex_;               ///< Who does something holds it, so that the end can wait.
};

}  // namespace pirt::runtime
