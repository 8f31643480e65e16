// How many tasks have not ended, and who waits until there are fewer.
#pragma once

#include <cstddef>
#include <cstdint>

#include "scheduler/runtime/bell.h"

namespace pirt::runtime {

/// Any thread may call it.
class Room {
 public:
  /// @param most  Tasks, at least 1. Who finds as many goes on when a quarter of them has ended.
  explicit Room(std::size_t most) : most_(most), resume_at_(most - 1 - (most - 1) / 4) {}

  /// One more.
  /// @return  False if there are as many as there may be.
  [[nodiscard]] bool try_enter() {
    if (tasks_.fetch_add(1) < most_) return true;
    tasks_.fetch_sub(1);
    return false;
  }
  /// The same, however many there are.
  void enter() { tasks_.fetch_add(1); }
  void leave() {
    const std::size_t remaining = tasks_.fetch_sub(1) - 1;
    if (remaining <= resume_at_) for_room_.ring(INT32_MAX);
    if (remaining == 0) look_again();
  }

  void wait_for_room() {
    for_room_.sleep_until([this] { return tasks_ <= resume_at_; });
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
