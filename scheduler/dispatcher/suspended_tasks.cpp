// Tasks that are suspended between two slices, and what is let in there.
#include <algorithm>
#include <bit>

#include "scheduler/dispatcher/dispatcher.h"

namespace pirt {

/// From now on what waits is looked at by deadline.
void Dispatcher::note_urgent() {
  if (waiting_.slices_end()) return;
  waiting_.note_urgent();
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    for (TaskSlot slot = units_[unit].queue.front(); slot != kNoSlot; slot = tasks_[slot].next) {
      if (is_urgent(slot)) urgent_with(slot, unit).insert(tasks_.by_deadline(slot));
    }
  }
}

/// The task does not run for now.
void Dispatcher::suspend(TaskSlot slot, UnitId unit) {
  tasks_[slot].suspended = true;
  units_[unit].suspended.push_back(slot);
  suspending_ |= unit_bit(unit);
  --units_[unit].running;
  note_running(unit);
}

/// The last task that was suspended there runs again.
void Dispatcher::resume(UnitId unit) {
  Unit& its = units_[unit];
  tasks_[its.suspended.back()].suspended = false;
  its.suspended.pop_back();
  if (its.suspended.empty()) suspending_ &= ~unit_bit(unit);
  ++its.running;
  note_running(unit);
}

/// Starts what waits for the unit, all of whose tasks are suspended, with the nearest deadline, if
/// that is before @p before; false if nothing does, or the policy refuses it.
bool Dispatcher::let_in(UnitId unit, Nanos before, Effects& out) {
  if (!contains(up_, unit)) return false;
  urgent_.clear();
  // A kernel is not called anew before its call has ended: none of the same workload is let in.
  const auto workload_of = [this](TaskSlot slot) { return waiting_.class_at(slot).kind.workload; };
  const auto consider = [&](TaskSlot slot) {
    if (tasks_[slot].deadline >= before) return;
    const auto& suspended = units_[unit].suspended;
    if (std::ranges::find(suspended, workload_of(slot), workload_of) != suspended.end()) return;
    urgent_.push_back(slot);
  };
  // Of each workload in its queue the nearest: no policy is asked for it.
  for (const auto& [workload, tasks] : units_[unit].urgent) {
    if (!tasks.empty()) consider(std::get<2>(*tasks.begin()));
  }
  waiting_.visit_nearest_for(unit, consider);
  std::ranges::sort(urgent_, {}, [this](TaskSlot each) { return tasks_.by_deadline(each); });
  const auto twice = std::ranges::unique(urgent_);  // Of a class that is held and prioritized.
  urgent_.erase(twice.begin(), twice.end());
  for (const TaskSlot slot : urgent_) {
    if (!take_in(slot, unit)) continue;
    start(slot, unit, out);
    out.started.back().let_in = true;
    return true;
  }
  return false;
}

/// Takes the task out of the queue that it is in, so that it may start on the unit. One that is
/// held only if the policy gives it to that now, which sees no load of what is suspended there.
bool Dispatcher::take_in(TaskSlot slot, UnitId unit) {
  const TaskClass& kind = waiting_.class_at(slot).kind;
  switch (tasks_[slot].state) {
    case TaskState::kQueued:
      take_from_queue(slot, unit);
      return true;
    case TaskState::kHighPriority:
      waiting_.erase(slot);
      enter(slot, unit, view());
      return true;
    case TaskState::kHeld:
      break;
    default:
      return false;
  }
  shown_ = load_;
  shown_[unit] -= suspended(unit);
  const UnitsView units = {.load = shown_, .up = up_, .now = now_};
  const Placement placement = policy_->place(kind, units);
  if (placement.holds()) return false;
  waiting_.had_turn(kind.entry);
  waiting_.erase(slot);
  if (placement.kind == Placement::Kind::kHighPriority) {
    waiting_.prioritize(slot);
    return false;
  }
  put_in_queue(slot, placement.unit, units);
  if (placement.unit != unit) return false;
  take_from_queue(slot, unit);
  return true;
}

/// Where what was let in has ended: something else is, or what was suspended is resumed.
void Dispatcher::resume_suspended(Effects& out) {
  for (UnitMask units = suspending_; units != 0; units &= units - 1) {
    const auto unit = static_cast<UnitId>(std::countr_zero(units));
    Unit& its = units_[unit];
    while (!its.suspended.empty() && its.running < its.slots) {
      const TaskSlot innermost = its.suspended.back();
      if (let_in(unit, tasks_[innermost].deadline, out)) continue;
      out.resumed.push_back({tasks_[innermost].id, unit});
      resume(unit);
    }
  }
}

}  // namespace pirt
