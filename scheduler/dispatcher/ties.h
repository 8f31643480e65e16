// What binds tasks beyond their predecessors: states, which one task at a time holds in the order
// of submission, and series, of which a later firing reads the newest that completes.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "scheduler/dispatcher/task_store.h"
#include "scheduler/mix/task.h"

namespace pirt {

class Ties {
 public:
  /// @param tasks  Must outlive it.
  explicit Ties(TaskStore& tasks) : tasks_(tasks) {}

  // A task that is submitted awaits first, and joins when all that are submitted with it have: of
  // those, none reads another.

  /// It waits for the newest of each series that it reads.
  void await_earlier(TaskSlot slot, const Task& task);
  /// It lines up for its state, and is the newest of its series.
  void join(TaskSlot slot, const Task& task);
  /// It has ended: the next holds its state, and what reads it has its data or reads the next older
  /// one in its place.
  void leave(TaskSlot slot, bool completed) {
    if (tasks_[slot].in_state) leave_state(slot);
    if (tasks_[slot].in_series) decide(slot, completed);
  }
  /// It will not complete, but still holds its state.
  void cancel(TaskSlot slot) {
    if (tasks_[slot].in_series) decide(slot, false);
  }

  // What that brought about, until it is taken. Noted ones may have ended meanwhile.

  [[nodiscard]] bool frees() const { return !freed_.empty(); }
  [[nodiscard]] bool has_news() const { return frees() || !unmet_.empty(); }
  /// They wait for a state, or for what they read, no longer.
  template <typename Visit>
  void take_freed(const Visit& visit) {
    take(freed_, visit);
  }
  /// Nothing that they read will ever be there. What @p visit does may add more.
  template <typename Visit>
  void take_unmet(const Visit& visit) {
    take(unmet_, visit);
  }

 private:
  struct StateQueue {
    TaskSlot head =
        kNoSlot;  ///< Holds the state, or will when the rest of what it waits for is there.
    TaskSlot tail = kNoSlot;
  };

  template <typename Visit>
  void take(std::vector<TaskId>& noted, const Visit& visit) {
    for (std::size_t i = 0; i < noted.size(); ++i) {
      if (const TaskSlot slot = tasks_.find_live(noted[i]); slot != kNoSlot) visit(slot);
    }
    noted.clear();
  }
  void leave_state(TaskSlot slot);
  void decide(TaskSlot slot, bool completed);
  void free_from_one(TaskSlot slot);

  TaskStore& tasks_;
  std::vector<StateQueue> states_;
  /// By series: the newest that is not decided, kDoneSlot, kNoSlot.
  std::vector<TaskSlot> series_;
  std::vector<TaskId> unmet_, freed_;
  std::vector<TaskSlot> readers_;  ///< Of decide, kept for its memory.
};

}  // namespace pirt
