// How threads wait for each other: who has nothing to do sleeps until somebody rings; who rings
// enters the system only where somebody sleeps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

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

/// Something that happens once, and that some wait for, for as long as they like: std::latch
/// without a limit of time is all that C++20 has.
class Latch {
 public:
  /// Who sees it set sees what was written before.
  [[nodiscard]] bool is_set() const { return set_; }
  /// It lives until this has returned, though whoever waits may go on before.
  void set() {
    set_ = true;
    bell_.ring(INT32_MAX);
  }
  /// Nobody waits, and nobody will before this has become known to them.
  void reset() { set_.store(false, std::memory_order_relaxed); }
  void wait() { wait_for(Nanos::max()); }
  /// @return  Whether it is set.
  bool wait_for(Nanos most) {
    if (is_set()) return true;
    bell_.sleep_until([this] { return is_set(); }, later_by(LiveClock().now(), most));
    return is_set();
  }

 private:
  Atomic<bool> set_ = false;
  Bell bell_;
};

/// Whose turn it is: one thread at a time is within; who only leaves something never waits for it.
/// store(taken) -> load(what was left) of who gives it back, seq_cst; pairs with leave something ->
/// try_take: who finds it taken is found. A std::mutex promises nothing of the kind.
class Turn {
 public:
  /// The turn, until it goes; or nothing, if another thread has it.
  class Held {
   public:
    Held() = default;
    Held(Held&& other) noexcept : turn_(std::exchange(other.turn_, nullptr)) {}
    Held& operator=(Held&&) = delete;
    ~Held() { give_back(); }
    explicit operator bool() const { return turn_ != nullptr; }
    void give_back() {
      if (turn_ != nullptr) std::exchange(turn_, nullptr)->give_back();
    }
    /// Nobody gets it any more.
    void keep_for_good() { turn_ = nullptr; }

   private:
    friend class Turn;
    explicit Held(Turn& turn) : turn_(&turn) {}
    Turn* turn_ = nullptr;
  };

  [[nodiscard]] Held try_take() { return taken_.exchange(true) ? Held() : Held(*this); }
  /// Sleeps until it is free, so that a thread of higher priority lets its holder run.
  [[nodiscard]] Held take() {
    free_.sleep_until([this] { return !taken_.exchange(true); });
    return Held(*this);
  }

 private:
  void give_back() {
    taken_ = false;
    free_.ring(1);
  }
  Atomic<bool> taken_ = false;
  Bell free_;
};

/// How many tasks have not ended, and who waits until there are fewer. Any thread may call it.
class Room {
 public:
  /// @param most  Tasks, at least 1. Who finds as many goes on when a quarter of them has ended.
  explicit Room(std::size_t most) : most_(most), resume_at_(most - 1 - (most - 1) / 4) {}

  /// One more.
  /// @param may_wait  Until there are fewer, if there are as many as there may be.
  void enter(bool may_wait) {
    if (tasks_.fetch_add(1) < most_ || !may_wait) return;
    tasks_.fetch_sub(1);
    for_room_.sleep_until([this] { return tasks_ <= resume_at_; });
    tasks_.fetch_add(1);
  }
  void leave() {
    const std::size_t remaining = tasks_.fetch_sub(1) - 1;
    if (remaining <= resume_at_) for_room_.ring(INT32_MAX);
    if (remaining == 0) look_again();
  }

  void wait_until_empty() {
    wait_until([this] { return tasks_ == 0; });
  }
  /// Until something else has come, of which look_again tells.
  template <typename Done>
  void wait_until(const Done& done) {
    for_others_.sleep_until(done);
  }
  void look_again() { for_others_.ring(INT32_MAX); }

 private:
  const std::size_t most_, resume_at_;
  Atomic<std::size_t> tasks_ = 0;
  Bell for_room_, for_others_;
};

}  // namespace pirt::runtime
