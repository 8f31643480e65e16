// What becomes of tasks whose unit does not complete them: it gives them back, they are wanted back
// in time, or it is away.
#include <optional>
#include <utility>
#include <vector>

#include "scheduler/dispatcher/dispatcher.h"

namespace pirt {

/// The task waits for another unit, in the place in line that it had. A plan knows no other unit:
/// the policy takes it nowhere.
void Dispatcher::give_back(TaskSlot slot, UnitId unit, Effects& out) {
  ++counts_.returned;
  waiting_.forget_refusals();
  TaskTies& ties = tasks_.tie(slot);
  const bool recalled = contains(ties.returned_by, unit);  // Which is no try.
  ties.returned_by |= unit_bit(unit);
  TaskClass kind = waiting_.class_at(slot).kind;
  kind.eligible &= ~(ties.returned_by | gone_);
  if (!recalled) ++ties.returns;
  const bool fails = ties.returns == kMostTries || policy_->takers(kind, kind.eligible) == 0;
  depart(slot, unit, fails ? Whereabouts::nowhere() : Whereabouts::waiting());
  if (fails) {
    out.ended.push_back({tasks_[slot].id, TaskEnd::kFailed});
    return fail(slot, out);
  }
  tasks_[slot].class_index = waiting_.class_of(kind, up_);
  waiting_.hold(slot);
  if (ties.recall) recalls_.watch(slot, ties.recall->at);
  if (ties.expires_at) expiries_.watch(slot, *ties.expires_at);
  if (ties.recall || ties.expires_at) expire(now_, out);
}

/// From the units that it was to complete on by now, if others would take it.
void Dispatcher::take_back(TaskSlot slot, Effects& out) {
  TaskRecord& record = tasks_[slot];
  TaskTies& ties = tasks_.tie(slot);
  const UnitMask from = ties.recall->from;
  const TaskClass kind = once_back(slot, ties);
  if (is_over(record.state) || kind.eligible == 0) return;
  ties.returned_by |= from;  // It goes there no more.
  const bool placed = record.state == TaskState::kRunning || record.state == TaskState::kQueued;
  const bool there = placed && contains(from, record.unit);
  if (record.state == TaskState::kRunning) {
    if (there) out.recalled.push_back({record.id, record.unit});
    return;
  }
  const bool waits = there || waits_for_unit(record.state);
  if (waits) unlink(slot, Whereabouts::waiting());
  record.class_index = waiting_.class_of(kind, up_);
  if (!waits) return;
  waiting_.forget_refusals();
  waiting_.hold(slot);
}

/// The class of the task, which has a recall, once it is taken back; of no unit if nobody else
/// would take it.
TaskClass Dispatcher::once_back(TaskSlot slot, const TaskTies& ties) const {
  TaskClass kind = waiting_.class_at(slot).kind;
  kind.eligible &= ~(ties.recall->from | ties.returned_by | gone_);
  if (policy_->takers(kind, kind.eligible) == 0) kind.eligible = 0;
  return kind;
}

std::optional<Recall> Dispatcher::recall(TaskId task) const {
  const TaskSlot slot = tasks_.find_live(task);
  const TaskTies* const ties = slot != kNoSlot ? tasks_.find_ties(slot) : nullptr;
  if (ties == nullptr || !ties->recall || once_back(slot, *ties).eligible == 0) return std::nullopt;
  return ties->recall;
}

/// What waits in the unit's queue waits for others; if it is gone, all that it could have taken.
void Dispatcher::hand_on(UnitId unit) {
  std::vector<TaskSlot> waiting;
  while (!units_[unit].queue.empty()) {
    waiting.push_back(units_[unit].queue.front());
    unlink(waiting.back(), Whereabouts::waiting());
  }
  waiting_.take_those_of(unit, gone_, waiting);
  for (const TaskSlot slot : waiting) {
    leave_gone(slot);
    waiting_.hold(slot);
  }
}

/// The task is of the class that does without the units that are gone, from now on.
void Dispatcher::leave_gone(TaskSlot slot) {
  TaskClass kind = waiting_.class_at(slot).kind;
  if ((kind.eligible & gone_) == 0) return;
  kind.eligible &= ~gone_;
  tasks_[slot].class_index = waiting_.class_of(kind, up_);
}

}  // namespace pirt
