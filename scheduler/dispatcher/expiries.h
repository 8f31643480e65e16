// Tasks that something happens to when their time has come: those that have not started expire,
// those that have not completed somewhere are taken back.
#pragma once

#include <algorithm>
#include <compare>
#include <cstdint>
#include <functional>
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

  void watch(TaskSlot slot, Nanos at) {
    tasks_[slot].*watched_ = true;
    ++live_;
    heap_.push_back({at, sequence_++, tasks_[slot].id});
    std::ranges::push_heap(heap_, std::greater{});
  }
  /// Nothing happens to it any more.
  void forget(TaskSlot slot) {
    if (std::exchange(tasks_[slot].*watched_, false)) --live_;
  }
  /// Before any of these is asked: keeps a live entry at the top, and memory in proportion to the
  /// tasks that are watched.
  void tidy() {
    if (heap_.empty()) return;
    if (heap_.size() > 2 * live_ + 64) {
      std::erase_if(heap_, [this](const Expiry& expiry) { return is_stale(expiry); });
      std::ranges::make_heap(heap_, std::greater{});
    }
    while (!heap_.empty() && is_stale(heap_.front())) {
      std::ranges::pop_heap(heap_, std::greater{});
      heap_.pop_back();
    }
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

  TaskStore& tasks_;
  bool TaskRecord::*watched_;
  /// Earliest first; may hold entries of tasks that are forgotten.
  std::vector<Expiry> heap_;
  std::size_t live_ = 0;
  std::uint64_t sequence_ = 0;
};

}  // namespace pirt
