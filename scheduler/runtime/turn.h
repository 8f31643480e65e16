// Whose turn it is: one thread at a time is within; who only leaves something never waits for it.
// exchange(state) -> load(what was left) of who gives it back, seq_cst; pairs with leave something
// -> try_take: who finds it taken is found. A std::mutex promises nothing of the kind.
#pragma once

#include <cstdint>
#include <utility>

#include "scheduler/runtime/threads.h"

namespace pirt::runtime {

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

  [[nodiscard]] Held try_take() {
    std::uint32_t free = kFree;
    return state_.compare_exchange_strong(free, kTaken) ? Held(*this) : Held();
  }
  /// Sleeps until it is free, so that a thread of higher priority lets its holder run.
  [[nodiscard]] Held take() {
    std::uint32_t state = kFree;
    if (state_.compare_exchange_strong(state, kTaken)) return Held(*this);
    while (state_.exchange(kAwaited) != kFree) state_.wait(kAwaited);
    return Held(*this);
  }

 private:
  enum : std::uint32_t { kFree, kTaken, kAwaited };
  void give_back() {
    if (state_.exchange(kFree) == kAwaited) state_.notify_one();
  }
  Atomic<std::uint32_t> state_ = kFree;
};

}  // namespace pirt::runtime
