#include "scheduler/dispatcher/dispatcher.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <limits>
#include <utility>

namespace pirt {

Dispatcher::Dispatcher(std::vector<std::optional<int>> slots, std::unique_ptr<Policy> policy)
    : policy_(std::move(policy)), load_(slots.size(), 0), start_order_(policy_->order()) {
  assert(slots.size() <= kMaxUnits);
  for (UnitId unit = 0; unit < slots.size(); ++unit) {
    units_.push_back({.slots = slots[unit].value_or(std::numeric_limits<int>::max())});
    all_ |= unit_bit(unit);
    if (std::ranges::find(start_order_, unit) == start_order_.end()) start_order_.push_back(unit);
  }
  up_ = all_;
  for (UnitId unit = 0; unit < units_.size(); ++unit) note_running(unit);
}

bool Dispatcher::release(FiringId firing, Nanos now) {
  Effects none;
  return take({.kind = DispatcherInput::Kind::kRelease, .firing = firing}, now, none,
              [&](DispatcherInput&) { return tasks_.release(firing); });
}

bool Dispatcher::complete(UnitId unit, TaskId task, Outcome outcome, Nanos now, Effects& out) {
  const DispatcherInput input = {
      .kind = DispatcherInput::Kind::kComplete, .task = task, .unit = unit, .outcome = outcome};
  return take(input, now, out, [&](DispatcherInput&) {
    const TaskSlot slot = tasks_.find(task);
    if (slot == kNoSlot || tasks_[slot].unit != unit) return false;
    const TaskState state = tasks_[slot].state;
    if (state != TaskState::kRunning && state != TaskState::kCancelled) return false;
    recalls_.forget(slot);  // It is back.
    expire(now_, out);
    if (std::exchange(tasks_[slot].suspended, false)) {
      std::erase(units_[unit].suspended, slot);
      if (units_[unit].suspended.empty()) suspending_ &= ~unit_bit(unit);
    } else {
      --units_[unit].running;
    }
    const bool returned = state == TaskState::kRunning && outcome == Outcome::kReturned;
    if (!returned) depart(slot, unit, Whereabouts::nowhere());
    note_running(unit);
    if (state == TaskState::kRunning && outcome == Outcome::kCompleted) {
      ++counts_.completed;
      released_.clear();
      tasks_.successors(slot, released_);
      ties_.leave(slot, true);
      tasks_.remove(slot);
      waiting_.forget_refusals();
      const bool alone = released_.size() == 1 && !ties_.frees();
      for (const TaskSlot successor : released_) {
        if (--tasks_[successor].pending == 0) make_ready(successor, alone);
      }
    } else if (state == TaskState::kCancelled) {
      end(slot);
    } else if (returned) {
      give_back(slot, unit, out);
    } else {
      fail(slot, out);
    }
    settle(out);
    return true;
  });
}

bool Dispatcher::slice_ended(UnitId unit, TaskId task, Nanos now, Effects& out) {
  const DispatcherInput input = {
      .kind = DispatcherInput::Kind::kSliceEnded, .task = task, .unit = unit};
  return take(input, now, out, [&](DispatcherInput&) {
    const TaskSlot slot = tasks_.find(task);
    if (slot == kNoSlot || tasks_[slot].unit != unit || tasks_[slot].suspended) return false;
    const TaskState state = tasks_[slot].state;
    if (state != TaskState::kRunning && state != TaskState::kCancelled) return false;
    expire(now_, out);
    note_urgent();
    suspend(slot, unit);
    if (let_in(unit, tasks_[slot].deadline, out)) {
      out.suspended.push_back({task, unit});
      ++counts_.suspended;
    } else {
      resume(unit);
    }
    settle(out);
    return true;
  });
}

void Dispatcher::cancel(TaskId task, Nanos now, Effects& out) {
  take({.kind = DispatcherInput::Kind::kCancel, .task = task}, now, out, [&](DispatcherInput&) {
    expire(now_, out);
    const TaskSlot slot = tasks_.find(task);
    if (slot != kNoSlot && tasks_[slot].state == TaskState::kRunning) {
      tasks_[slot].state = TaskState::kCancelled;
      count_drop(slot, TaskEnd::kDropped, out);
      drop_successors(slot, TaskEnd::kDropped, out);
      ties_.cancel(slot);
    } else if (slot != kNoSlot && !is_over(tasks_[slot].state)) {
      drop(slot, TaskEnd::kDropped, out);
    }
    settle(out);
    return true;
  });
}

bool Dispatcher::set_unit(UnitId unit, UnitState state, Nanos now, Effects& out) {
  const DispatcherInput input = {
      .kind = DispatcherInput::Kind::kSetUnit, .unit = unit, .state = state};
  return take(input, now, out, [&](DispatcherInput&) {
    if (unit >= units_.size()) return false;
    expire(now_, out);
    up_ = state == UnitState::kUp ? up_ | unit_bit(unit) : up_ & ~unit_bit(unit);
    gone_ = state == UnitState::kGone ? gone_ | unit_bit(unit) : gone_ & ~unit_bit(unit);
    waiting_.set_up(up_);
    policy_->units_changed(up_);
    note_running(unit);
    if (state != UnitState::kUp) hand_on(unit);
    waiting_.forget_refusals();
    settle(out);
    return true;
  });
}

void Dispatcher::wake(Nanos now, Effects& out) {
  take({.kind = DispatcherInput::Kind::kWake}, now, out, [&](DispatcherInput&) {
    expire(later_by(now_, Nanos(1)), out);
    settle(out);
    return true;
  });
}

/// What every input but release ends with.
void Dispatcher::settle(Effects& out) {
  if (ties_.has_news() || waiting_.despairs()) take_news(out);
  if (ask_again_ <= now_) waiting_.forget_refusals();
  waiting_.place_held([this](TaskSlot slot) { return place(slot); });
  if (suspending_ != 0) resume_suspended(out);
  ask_again_ = waiting_.holds_any() ? policy_->ask_again() : Nanos::max();
  if (ask_again_ <= now_) ask_again_ = Nanos::max();
  start_all(out);
  expiries_.tidy();
  recalls_.tidy();
  next_wake_ = std::min({expiries_.next(), recalls_.next(), ask_again_});
}

void Dispatcher::list_waiting(std::vector<int>& waiting) const {
  waiting.clear();
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    waiting.push_back(load_[unit] - units_[unit].running - suspended(unit));
  }
  waiting.push_back(static_cast<int>(waiting_.size()));
}

std::optional<TaskState> Dispatcher::state(TaskId task) const {
  const TaskSlot slot = tasks_.find_live(task);
  return slot == kNoSlot ? std::nullopt : std::optional(tasks_[slot].state);
}

/// The task waits for a unit from now on; place_held asks for it.
/// @param alone  No other becomes ready at once; without held ones it has none to compete with.
void Dispatcher::make_ready(TaskSlot slot, bool alone) {
  tasks_[slot].sequence = ready_sequence_++;
  tasks_[slot].ready_at = now_;
  if (gone_ != 0) leave_gone(slot);
  const bool hopeless = waiting_.class_at(slot).hopeless;
  if (!alone || hopeless || waiting_.holds_any() || !place(slot)) waiting_.hold(slot);
}

/// Asks the policy. False if it refuses; the task is then in no queue.
bool Dispatcher::place(TaskSlot slot) {
  if (waiting_.class_at(slot).parked) return false;
  const TaskClass& kind = waiting_.class_at(slot).kind;
  const UnitsView units = view();
  const Placement placement = policy_->place(kind, units);
  switch (placement.kind) {
    case Placement::Kind::kHold:
      waiting_.class_at(slot).awaits = std::nullopt;
      return false;
    case Placement::Kind::kHoldFor:
      waiting_.class_at(slot).awaits = placement.awaits;
      return false;
    case Placement::Kind::kHoldBehind:
      waiting_.park(waiting_.class_at(slot), static_cast<std::uint32_t>(placement.awaits));
      return false;
    case Placement::Kind::kHighPriority:
      waiting_.prioritize(slot);
      break;
    case Placement::Kind::kUnit:
      assert(contains(kind.eligible & up_, placement.unit));
      put_in_queue(slot, placement.unit, units);
      break;
  }
  waiting_.had_turn(kind.entry);
  return true;
}

void Dispatcher::tell_moved(TaskSlot slot, Whereabouts from, Whereabouts to,
                            const UnitsView& shown) {
  policy_->moved({.kind = waiting_.class_at(slot).kind, .deadline = tasks_[slot].deadline}, from,
                 to, shown);
}

/// The task, which waited, counts in the unit's load.
/// @param shown  What the policy saw when it chose the unit.
void Dispatcher::enter(TaskSlot slot, UnitId unit, const UnitsView& shown) {
  tell_moved(slot, Whereabouts::waiting(), Whereabouts::on(unit), shown);
  tasks_[slot].dispatched_at = now_;
  ++load_[unit];
}

/// It counts there no more.
void Dispatcher::depart(TaskSlot slot, UnitId unit, Whereabouts to) {
  --load_[unit];
  waiting_.note_fall(unit);
  tell_moved(slot, Whereabouts::on(unit), to, view());
}

void Dispatcher::put_in_queue(TaskSlot slot, UnitId unit, const UnitsView& shown) {
  enter(slot, unit, shown);
  TaskRecord& record = tasks_[slot];
  record.state = TaskState::kQueued;
  record.unit = unit;
  units_[unit].queue.insert(tasks_, slot);
  if (is_urgent(slot)) urgent_with(slot, unit).insert(tasks_.by_deadline(slot));
  queued_ |= unit_bit(unit);
}

void Dispatcher::start_all(Effects& out) {
  const UnitMask able = idle_ & (waiting_.prioritizes_any() ? all_ : queued_);
  if (able == 0) return;
  if ((able & (able - 1)) == 0) return fill(static_cast<UnitId>(std::countr_zero(able)), out);
  for (const UnitId id : start_order_) {
    if (contains(able, id)) fill(id, out);
  }
}

void Dispatcher::fill(UnitId id, Effects& out) {
  while (contains(idle_, id)) {
    const TaskSlot slot = next_for(id);
    if (slot == kNoSlot) break;
    start(slot, id, out);
  }
}

/// What runs there has changed, or its state.
void Dispatcher::note_running(UnitId id) {
  const Unit& unit = units_[id];
  const bool idle = contains(up_, id) && unit.running < unit.slots;
  idle_ = idle ? idle_ | unit_bit(id) : idle_ & ~unit_bit(id);
}

/// What the idle unit starts: of the high-priority queue, which falls here, at dispatch, before its
/// own.
TaskSlot Dispatcher::next_for(UnitId id) {
  Unit& unit = units_[id];
  if (const TaskSlot slot = waiting_.first_for(id); slot != kNoSlot) {
    waiting_.erase(slot);
    enter(slot, id, view());
    return slot;
  }
  if (unit.queue.empty()) return kNoSlot;
  const TaskSlot slot = unit.queue.front();
  take_from_queue(slot, id);
  return slot;
}

/// The task is counted in the unit's load and in no queue.
void Dispatcher::start(TaskSlot slot, UnitId unit, Effects& out) {
  TaskRecord& record = tasks_[slot];
  record.state = TaskState::kRunning;
  record.unit = unit;
  ++units_[unit].running;
  note_running(unit);
  expiries_.forget(slot);
  out.started.push_back({record.id, unit, record.dispatched_at, record.ready_at});
}

void Dispatcher::take_from_queue(TaskSlot slot, UnitId unit) {
  TaskList& queue = units_[unit].queue;
  queue.erase(tasks_, slot);
  if (is_urgent(slot)) urgent_with(slot, unit).erase(tasks_.by_deadline(slot));
  if (queue.empty()) queued_ &= ~unit_bit(unit);
}

}  // namespace pirt
