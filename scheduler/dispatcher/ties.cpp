#include "scheduler/dispatcher/ties.h"

namespace pirt {

void Ties::await_earlier(TaskSlot slot, const Task& task) {
  for (const SeriesId series : task.reads) {
    const TaskSlot newest = series < series_.size() ? series_[series] : kNoSlot;
    if (newest == kDoneSlot) continue;
    if (newest == kNoSlot) {
      unmet_.push_back(tasks_[slot].id);
    } else {
      tasks_.add_reader(newest, slot);
      ++tasks_[slot].pending;
    }
  }
}

void Ties::join(TaskSlot slot, const Task& task) {
  if (task.state) {
    if (*task.state >= states_.size()) states_.resize(*task.state + std::size_t{1});
    TaskTies& ties = tasks_.tie(slot);
    StateQueue& queue = states_[*task.state];
    ties.state = *task.state;
    ties.state_before = queue.tail;
    if (queue.tail == kNoSlot) {
      queue.head = slot;
    } else {
      tasks_.ties(queue.tail).state_behind = slot;
      ++tasks_[slot].pending;
    }
    queue.tail = slot;
    tasks_[slot].in_state = true;
  }
  if (task.series) {
    if (*task.series >= series_.size()) series_.resize(*task.series + std::size_t{1}, kNoSlot);
    TaskTies& ties = tasks_.tie(slot);
    ties.series = *task.series;
    ties.older = std::exchange(series_[*task.series], slot);
    if (ties.older < kDoneSlot) tasks_.ties(ties.older).newer = slot;
    tasks_[slot].in_series = true;
  }
}

void Ties::leave_state(TaskSlot slot) {
  const TaskTies& ties = tasks_.ties(slot);
  StateQueue& queue = states_[ties.state];
  tasks_[slot].in_state = false;
  const auto [before, behind] = std::pair(ties.state_before, ties.state_behind);
  (before == kNoSlot ? queue.head : tasks_.ties(before).state_behind) = behind;
  (behind == kNoSlot ? queue.tail : tasks_.ties(behind).state_before) = before;
  if (before == kNoSlot && behind != kNoSlot) free_from_one(behind);
}

void Ties::decide(TaskSlot slot, bool completed) {
  const TaskTies& ties = tasks_.ties(slot);
  const TaskSlot stands = completed ? kDoneSlot : ties.older;
  tasks_[slot].in_series = false;
  if (ties.newer != kNoSlot) {
    tasks_.ties(ties.newer).older = stands;
  } else if (series_[ties.series] == slot) {
    series_[ties.series] = stands;
  }
  // Nobody who is still to come looks behind one that completed.
  if (ties.older < kDoneSlot) tasks_.ties(ties.older).newer = completed ? kNoSlot : ties.newer;
  readers_.clear();
  tasks_.take_readers(slot, readers_);
  for (const TaskSlot reader : readers_) {
    if (stands == kDoneSlot) {
      free_from_one(reader);
    } else if (stands == kNoSlot) {
      unmet_.push_back(tasks_[reader].id);
    } else {
      tasks_.add_reader(stands, reader);
    }
  }
}

/// @param slot  Waits for one thing less. One that is about to be dropped waits for none.
void Ties::free_from_one(TaskSlot slot) {
  TaskRecord& record = tasks_[slot];
  if (record.pending != 0 && --record.pending == 0) freed_.push_back(record.id);
}

}  // namespace pirt
