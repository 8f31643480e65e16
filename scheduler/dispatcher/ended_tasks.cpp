// How tasks end that do not complete: they fail, expire, are dropped with those before them, or
// find nothing to read.
#include <utility>
#include <vector>

#include "scheduler/dispatcher/dispatcher.h"

namespace pirt {

/// Ends what should have started before that, and takes back what should have completed.
void Dispatcher::expire_watched(Nanos before, Effects& out) {
  expiries_.tidy();
  while (expiries_.next() < before) {
    const TaskSlot slot = expiries_.first();
    ++counts_.expired;
    out.ended.push_back({tasks_[slot].id, TaskEnd::kExpired});
    unlink(slot, Whereabouts::nowhere());
    drop_successors(slot, TaskEnd::kDropped, out);
    end(slot);
    expiries_.tidy();
  }
  recalls_.tidy();
  while (recalls_.next() < before) {
    const TaskSlot slot = recalls_.first();
    recalls_.forget(slot);
    take_back(slot, out);
    recalls_.tidy();
  }
}

/// Each may leave others unmet.
void Dispatcher::drop_unmet(Effects& out) {
  ties_.take_unmet([&](TaskSlot slot) { drop(slot, TaskEnd::kNoPredecessor, out); });
}

void Dispatcher::take_news(Effects& out) {
  while (true) {
    drop_unmet(out);
    ties_.take_freed([this](TaskSlot slot) {
      if (tasks_[slot].state == TaskState::kWaiting && tasks_[slot].pending == 0) {
        make_ready(slot, false);
      }
    });
    if (!waiting_.despairs()) break;
    // What no unit will ever take fails. Others may hold its state now, or have nothing to read.
    waiting_.take_hopeless([&](TaskSlot slot) {
      out.ended.push_back({tasks_[slot].id, TaskEnd::kFailed});
      fail(slot, out);
    });
  }
}

/// The task has failed, and was running.
void Dispatcher::fail(TaskSlot slot, Effects& out) {
  ++counts_.failed;
  drop_successors(slot, TaskEnd::kDropped, out);
  end(slot);
}

/// Takes a task that has not started out of the queue that it is in, if it is in one.
/// @param to  Where it is from now on; of one that was placed the policy hears it now.
void Dispatcher::unlink(TaskSlot slot, Whereabouts to) {
  const TaskRecord& record = tasks_[slot];
  if (record.state == TaskState::kQueued) {
    take_from_queue(slot, record.unit);
    depart(slot, record.unit, to);
  } else if (waits_for_unit(record.state)) {
    waiting_.erase(slot);
  }
}

void Dispatcher::count_drop(TaskSlot slot, TaskEnd how, Effects& out) {
  ++counts_.dropped;
  if (how == TaskEnd::kNoPredecessor) ++counts_.no_predecessor;
  out.ended.push_back({tasks_[slot].id, how});
}

/// Drops a task that has not started, and its successors.
void Dispatcher::drop(TaskSlot slot, TaskEnd how, Effects& out) {
  count_drop(slot, how, out);
  unlink(slot, Whereabouts::nowhere());
  drop_successors(slot, how, out);
  end(slot);
}

/// Successors of a task that did not complete; all of them still wait. Not recursive: a chain may
/// be long.
void Dispatcher::drop_successors(TaskSlot slot, TaskEnd how, Effects& out) {
  std::vector<TaskSlot> doomed = {slot};
  std::vector<TaskSlot> successors;
  for (std::size_t i = 0; i < doomed.size(); ++i) {
    successors.clear();
    tasks_.successors(doomed[i], successors);
    for (const TaskSlot each : successors) {
      // A diamond's end is reached twice; whoever waits has a predecessor pending, so that 0 marks
      // the doomed.
      if (std::exchange(tasks_[each].pending, 0) != 0) doomed.push_back(each);
    }
    if (i == 0) continue;
    count_drop(doomed[i], how, out);
    end(doomed[i]);
  }
}

/// The task is in no queue and will not complete.
void Dispatcher::end(TaskSlot slot) {
  const TaskState state = tasks_[slot].state;
  if (state == TaskState::kWaiting || waits_for_unit(state)) {
    tell_moved(slot, Whereabouts::waiting(), Whereabouts::nowhere(), view());
    waiting_.had_turn(waiting_.class_at(slot).kind.entry);
  }
  expiries_.forget(slot);
  recalls_.forget(slot);
  ties_.leave(slot, false);
  tasks_.end(slot);
  waiting_.forget_refusals();
}

}  // namespace pirt
