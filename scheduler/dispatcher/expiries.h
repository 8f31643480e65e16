// When tasks expire that have not started by then.
#pragma once

#include <compare>
#include <cstdint>
#include <utility>
#include <vector>

#include "scheduler/dispatcher/task_store.h"
#include "workloads/base/time.h"

namespace pirt {

class Expiries {
 public:
  /// @param tasks  Must outlive it.
  explicit Expiries(TaskStore& tasks) : tasks_(tasks) {}

  void watch(TaskSlot slot, Nanos at);
  /// It has started, or ended.
  void forget(TaskSlot slot) {
    if (std::exchange(tasks_[slot].expires, false)) --live_;
  }
  /// Before any of these is asked.
  void tidy() {
    if (!heap_.empty()) drop_stale();
  }
  [[nodiscard]] bool any() const { return !heap_.empty(); }
  /// When the first of them expires; Nanos::max() = none ever.
  [[nodiscard]] Nanos next() const { return heap_.empty() ? Nanos::max() : heap_.front().at; }
  /// Its task. Of those of one moment that which was submitted first.
  [[nodiscard]] TaskSlot first() const { return heap_.front().slot; }

 private:
  struct Expiry {
    Nanos at{0};
    std::uint64_t sequence = 0;  ///< Ties expire in order of submission.
    TaskSlot slot = kNoSlot;
    std::uint32_t generation = 0;
    friend auto operator<=>(const Expiry&, const Expiry&) = default;
  };

  [[nodiscard]] bool is_stale(const Expiry& expiry) const {
    return !tasks_.is_current(expiry.slot, expiry.generation) || !tasks_[expiry.slot].expires;
  }
  void drop_stale();

  TaskStore& tasks_;
  /// Earliest first; may hold entries of tasks that have started or ended.
  std::vector<Expiry> heap_;
  std::size_t live_ = 0;
  std::uint64_t sequence_ = 0;
};

}  // namespace pirt
