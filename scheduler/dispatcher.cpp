#include "scheduler/dispatcher.h"

#include <algorithm>
#include <cassert>
#include <functional>
#include <limits>
#include <utility>

namespace pirt {

Dispatcher::Dispatcher(std::vector<std::optional<int>> slots, std::unique_ptr<Policy> policy)
    : policy_(std::move(policy)), load_(slots.size(), 0), start_order_(policy_->order()) {
  assert(slots.size() <= kMaxUnits);
  for (UnitId unit = 0; unit < slots.size(); ++unit) {
    units_.push_back({.slots = slots[unit].value_or(std::numeric_limits<int>::max())});
    up_ |= unit_bit(unit);
    if (std::ranges::find(start_order_, unit) == start_order_.end()) start_order_.push_back(unit);
  }
}

void Dispatcher::submit(const Task& task, Nanos now, Starts& out) {
  const Report report(*this, out, [&] {
    return DispatcherInput{.kind = DispatcherInput::Kind::kSubmit, .now = now, .task = task};
  });
  advance(now);
  assert(tasks_.find(task.id) == kNoSlot && "the id of a task that is not done");
  const TaskSlot slot = tasks_.add(task.id);
  tasks_[slot].class_index = class_of(task.kind);
  tasks_[slot].rank = policy_->rank(task);
  ++counts_.submitted;
  for (const TaskId id : task.after) {
    const TaskSlot predecessor = tasks_.find(id);
    if (predecessor == kNoSlot) continue;
    if (tasks_[predecessor].state == TaskState::kCancelled) {
      drop(slot, out);
      return;
    }
    tasks_.add_successor(predecessor, slot);
    ++tasks_[slot].pending;
  }
  if (task.expires_at) watch_expiry(slot, *task.expires_at);
  if (tasks_[slot].pending == 0) make_ready(slot, now);
  start_all(now, out);
  tidy_expiries();
}

void Dispatcher::complete(UnitId unit, TaskId task, Outcome outcome, Nanos now, Starts& out) {
  const Report report(*this, out, [&] {
    return DispatcherInput{.kind = DispatcherInput::Kind::kComplete,
                           .now = now,
                           .task = Task{.id = task, .kind = {}, .deadline = {}, .expires_at = {}},
                           .unit = unit,
                           .outcome = outcome};
  });
  advance(now);
  const TaskSlot slot = tasks_.find(task);
  assert(slot != kNoSlot && tasks_[slot].unit == unit &&
         "completes a task that was not started there");
  const bool cancelled = tasks_[slot].state == TaskState::kCancelled;
  assert(cancelled || tasks_[slot].state == TaskState::kRunning);
  --units_[unit].running;
  --load_[unit];

  std::vector<TaskSlot> released;
  released.swap(scratch_);
  released.clear();
  if (!cancelled && outcome == Outcome::kCompleted) {
    ++counts_.completed;
    tasks_.successors(slot, released);
    std::erase_if(released,
                  [this](TaskSlot successor) { return --tasks_[successor].pending != 0; });
  } else if (!cancelled) {
    ++counts_.failed;
    drop_successors(slot, out);
  }
  tasks_.remove(slot);

  // Those that wait already come before those that are released now.
  place_held(now);
  for (const TaskSlot successor : released) make_ready(successor, now);
  released.swap(scratch_);
  start_all(now, out);
  tidy_expiries();
}

void Dispatcher::cancel(TaskId task, Nanos now, Starts& out) {
  const Report report(*this, out, [&] {
    return DispatcherInput{.kind = DispatcherInput::Kind::kCancel,
                           .now = now,
                           .task = Task{.id = task, .kind = {}, .deadline = {}, .expires_at = {}}};
  });
  advance(now);
  const TaskSlot slot = tasks_.find(task);
  if (slot == kNoSlot || tasks_[slot].state == TaskState::kCancelled) return;
  if (tasks_[slot].state == TaskState::kRunning) {
    tasks_[slot].state = TaskState::kCancelled;
    ++counts_.dropped;
    out.ended.push_back({task, Ending::kDropped});
    drop_successors(slot, out);
  } else {
    drop(slot, out);
  }
  place_held(now);
  start_all(now, out);
  tidy_expiries();
}

void Dispatcher::set_unit(UnitId unit, UnitState state, Nanos now, Starts& out) {
  const Report report(*this, out, [&] {
    return DispatcherInput{
        .kind = DispatcherInput::Kind::kSetUnit, .now = now, .unit = unit, .state = state};
  });
  advance(now);
  units_[unit].state = state;
  up_ = state == UnitState::kUp ? up_ | unit_bit(unit) : up_ & ~unit_bit(unit);
  for (auto& entry : classes_) entry.takers = policy_->takers(entry.kind, up_);
  while (state != UnitState::kUp && !units_[unit].queue.empty()) {
    const TaskSlot slot = units_[unit].queue.front();
    unlink(slot);
    hold(slot);
  }
  place_held(now);
  start_all(now, out);
  tidy_expiries();
}

void Dispatcher::wake(Nanos now, Starts& out) {
  const Report report(*this, out, [&] {
    return DispatcherInput{.kind = DispatcherInput::Kind::kWake, .now = now};
  });
  advance(now);
  tidy_expiries();
  while (!expiries_.empty() && expiries_.front().at <= now) {
    const TaskSlot slot = expiries_.front().slot;
    ++counts_.expired;
    out.ended.push_back({tasks_[slot].id, Ending::kExpired});
    unlink(slot);
    drop_successors(slot, out);
    forget(slot);
    tidy_expiries();
  }
  place_held(now);
  start_all(now, out);
  tidy_expiries();
}

std::optional<Nanos> Dispatcher::next_wake() const {
  return expiries_.empty() ? std::nullopt : std::optional(expiries_.front().at);
}

std::optional<TaskState> Dispatcher::state(TaskId task) const {
  const TaskSlot slot = tasks_.find(task);
  return slot == kNoSlot ? std::nullopt : std::optional(tasks_[slot].state);
}

void Dispatcher::advance(Nanos now) {
  assert(now >= now_ && "time runs backwards");
  now_ = now;
}

/// A mix has a handful of classes, so that a linear search is the fast one.
std::uint32_t Dispatcher::class_of(const TaskClass& kind) {
  const auto it = std::ranges::find(classes_, kind, &Class::kind);
  if (it == classes_.end()) {
    classes_.push_back({.kind = kind, .takers = policy_->takers(kind, up_)});
    return static_cast<std::uint32_t>(classes_.size() - 1);
  }
  return static_cast<std::uint32_t>(it - classes_.begin());
}

/// The task waits for a unit from now on.
void Dispatcher::make_ready(TaskSlot slot, Nanos now) {
  tasks_[slot].sequence = ready_sequence_++;
  tasks_[slot].ready_at = now;
  // Behind older ones of its class: what refuses them refuses it.
  if (!classes_[tasks_[slot].class_index].held.empty() || !place(slot, now)) hold(slot);
}

/// Asks the policy. False if it refuses; the task is then in no queue.
bool Dispatcher::place(TaskSlot slot, Nanos now) {
  TaskRecord& record = tasks_[slot];
  Class& entry = classes_[record.class_index];
  const Placement placement = policy_->place(entry.kind, {.load = load_, .up = up_, .now = now});
  switch (placement.kind) {
    case Placement::Kind::kHold:
      return false;
    case Placement::Kind::kHighPriority:
      record.state = TaskState::kHighPriority;
      entry.high_priority.insert(tasks_, slot);
      ++high_priority_count_;
      return true;
    case Placement::Kind::kUnit:
      assert(contains(entry.kind.eligible & up_, placement.unit));
      record.state = TaskState::kQueued;
      record.unit = placement.unit;
      record.dispatched_at = now;
      units_[placement.unit].queue.insert(tasks_, slot);
      ++load_[placement.unit];
      return true;
  }
  return false;
}

void Dispatcher::hold(TaskSlot slot) {
  tasks_[slot].state = TaskState::kHeld;
  classes_[tasks_[slot].class_index].held.insert(tasks_, slot);
  ++held_count_;
}

/// Places held tasks, oldest first, until every class is refused. Loads only rise meanwhile, so
/// that a refusal stands.
void Dispatcher::place_held(Nanos now) {
  if (held_count_ == 0) return;
  // Those that are neither empty nor refused: a task graph has a class a task, few of them held.
  asking_.clear();
  for (auto& entry : classes_) {
    if (!entry.held.empty()) asking_.push_back(&entry);
  }
  while (!asking_.empty()) {
    const auto oldest = std::ranges::min_element(asking_, [this](const Class* a, const Class* b) {
      return precedes(tasks_[a->held.front()], tasks_[b->held.front()]);
    });
    const TaskSlot slot = (*oldest)->held.front();
    unlink(slot);
    const bool placed = place(slot, now);
    if (!placed) hold(slot);
    if (!placed || (*oldest)->held.empty()) {
      *oldest = asking_.back();
      asking_.pop_back();
    }
  }
}

void Dispatcher::start_all(Nanos now, Starts& out) {
  for (const UnitId id : start_order_) {
    Unit& unit = units_[id];
    if (unit.state != UnitState::kUp) continue;
    while (unit.running < unit.slots) {
      TaskSlot slot = take_high_priority(id, now);
      if (slot == kNoSlot) {
        if (unit.queue.empty()) break;
        slot = unit.queue.front();
        unit.queue.erase(tasks_, slot);
      }
      start(slot, id, out);
    }
  }
}

/// The first task of the high-priority queue that the unit can serve; Qh falls here, at dispatch.
TaskSlot Dispatcher::take_high_priority(UnitId unit, Nanos now) {
  if (high_priority_count_ == 0) return kNoSlot;
  Class* oldest = nullptr;
  for (auto& entry : classes_) {
    if (entry.high_priority.empty() || !contains(entry.takers, unit)) continue;
    if (oldest == nullptr ||
        precedes(tasks_[entry.high_priority.front()], tasks_[oldest->high_priority.front()])) {
      oldest = &entry;
    }
  }
  if (oldest == nullptr) return kNoSlot;
  const TaskSlot slot = oldest->high_priority.front();
  unlink(slot);
  tasks_[slot].dispatched_at = now;
  ++load_[unit];
  return slot;
}

/// The task is counted in the unit's load and in no queue.
void Dispatcher::start(TaskSlot slot, UnitId unit, Starts& out) {
  TaskRecord& record = tasks_[slot];
  record.state = TaskState::kRunning;
  record.unit = unit;
  ++units_[unit].running;
  if (std::exchange(record.expires, false)) --expiring_count_;
  out.started.push_back({record.id, unit, record.dispatched_at, record.ready_at});
}

/// Takes a task that has not started out of the queue that it is in.
void Dispatcher::unlink(TaskSlot slot) {
  TaskRecord& record = tasks_[slot];
  Class& entry = classes_[record.class_index];
  switch (record.state) {
    case TaskState::kHeld:
      entry.held.erase(tasks_, slot);
      --held_count_;
      break;
    case TaskState::kHighPriority:
      entry.high_priority.erase(tasks_, slot);
      --high_priority_count_;
      break;
    case TaskState::kQueued:
      units_[record.unit].queue.erase(tasks_, slot);
      --load_[record.unit];
      break;
    case TaskState::kWaiting:
    case TaskState::kRunning:
    case TaskState::kCancelled:
      break;
  }
}

/// Drops a task that has not started, and its successors.
void Dispatcher::drop(TaskSlot slot, Starts& out) {
  ++counts_.dropped;
  out.ended.push_back({tasks_[slot].id, Ending::kDropped});
  unlink(slot);
  drop_successors(slot, out);
  forget(slot);
}

/// Successors of a task that did not complete; all of them still wait. Not recursive: a chain may
/// be long.
void Dispatcher::drop_successors(TaskSlot slot, Starts& out) {
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
    ++counts_.dropped;
    out.ended.push_back({tasks_[doomed[i]].id, Ending::kDropped});
    forget(doomed[i]);
  }
}

void Dispatcher::forget(TaskSlot slot) {
  const TaskState state = tasks_[slot].state;
  if (state == TaskState::kWaiting || state == TaskState::kHeld) {
    policy_->gone(classes_[tasks_[slot].class_index].kind);
  }
  if (tasks_[slot].expires) --expiring_count_;
  tasks_.remove(slot);
}

void Dispatcher::watch_expiry(TaskSlot slot, Nanos at) {
  tasks_[slot].expires = true;
  ++expiring_count_;
  const auto sequence = static_cast<std::uint64_t>(counts_.submitted);
  expiries_.push_back({at, sequence, slot, tasks_[slot].generation});
  std::ranges::push_heap(expiries_, std::greater{});
}

bool Dispatcher::is_stale(const Expiry& expiry) const {
  return !tasks_.is_current(expiry.slot, expiry.generation) || !tasks_[expiry.slot].expires;
}

/// Keeps a live entry at the top, and memory in proportion to the tasks that can still expire.
void Dispatcher::tidy_expiries() {
  if (expiries_.size() > 2 * expiring_count_ + 64) {
    std::erase_if(expiries_, [this](const Expiry& expiry) { return is_stale(expiry); });
    std::ranges::make_heap(expiries_, std::greater{});
  }
  while (!expiries_.empty() && is_stale(expiries_.front())) {
    std::ranges::pop_heap(expiries_, std::greater{});
    expiries_.pop_back();
  }
}

}  // namespace pirt
