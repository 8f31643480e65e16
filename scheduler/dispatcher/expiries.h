// Tasks that something happens to when their time has come: those that have not started expire,
// those that have not completed somewhere are taken back.
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
  /// @param tasks    Must outlive it.
  /// @param watched  Its own mark on those that it watches.
  Expiries(TaskStore& tasks, bool TaskRecord::*watched) : tasks_(tasks), watched_(watched) {}

  void watch(TaskSlot slot, Nanos at);
  /// Nothing happens to it any more.
  void forget(TaskSlot slot) {
    if (std::exchange(tasks_[slot].*watched_, false)) --live_;
  }
  /// Before any of these is asked.
  void tidy() {
    if (!heap_.empty()) drop_stale();
  }
  [[nodiscard]] bool any() const { return !heap_.empty(); }
  /// When the time of the first of them comes; Nanos::max() = never.
  [[nodiscard]] Nanos next() const { return heap_.empty() ? Nanos::max() : heap_.front().at; }
  /// Its task. Of those of one moment that which was submitted first.
  [[nodiscard]] TaskSlot first() const { return slot_of(heap_.front().task); }

 private:
  struct Expiry {
    Nanos at{0};
    std::uint64_t sequence = 0;  ///< Ties go in order of submission.
    TaskId task = kNoTask;
    friend auto operator<=>(const Expiry&, const Expiry&) = default;
  };

  [[nodiscard]] bool is_stale(const Expiry& expiry) const {
    const TaskSlot slot = tasks_.find_live(expiry.task);
    return slot == kNoSlot || !(tasks_[slot].*watched_);
  }
  void drop_stale();

  TaskStore& tasks_;
  bool TaskRecord::*watched_;
  /// Earliest first; may hold entries of tasks that are forgotten.
  std::vector<Expiry> heap_;
  std::size_t live_ = 0;
  std::uint64_t sequence_ = 0;
};

}  // namespace pirt
