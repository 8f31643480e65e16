#include "scheduler/dispatcher/dispatcher.h"

#include <algorithm>
#include <cassert>
#include <functional>
#include <limits>
#include <utility>

#include "workloads/base/math/random.h"

namespace pirt {

std::size_t Dispatcher::ClassHash::operator()(const TaskClass& kind) const {
  const std::uint64_t tags =
      (std::uint64_t{kind.entry} << 2) | (kind.real_time ? 2U : 0U) | (kind.image_input ? 1U : 0U);
  return static_cast<std::size_t>(hash_u64(hash_u64(kind.workload, kind.eligible), tags));
}

Dispatcher::Dispatcher(std::vector<std::optional<int>> slots, std::unique_ptr<Policy> policy)
    : policy_(std::move(policy)), load_(slots.size(), 0), start_order_(policy_->order()) {
  assert(slots.size() <= kMaxUnits);
  for (UnitId unit = 0; unit < slots.size(); ++unit) {
    units_.push_back({.slots = slots[unit].value_or(std::numeric_limits<int>::max())});
    all_ |= unit_bit(unit);
    if (std::ranges::find(start_order_, unit) == start_order_.end()) start_order_.push_back(unit);
  }
  up_ = all_;
}

/// Every input goes through here.
/// @param input  Makes what observers hear; only where somebody listens.
/// @param body   Carries it out; false if it is refused, and then has changed nothing.
template <typename Make, typename Body>
bool Dispatcher::take(Nanos now, Starts& out, const Make& input, const Body& body) {
  now_ = std::max(now_, now);
  const std::size_t started = out.started.size();
  const std::size_t ended = out.ended.size();
  const bool taken = body();
  if (!taken) ++refused_;
  if (observer_ != nullptr) {
    observer_->on_input(input(), {.taken = taken,
                                  .started = std::span(out.started).subspan(started),
                                  .ended = std::span(out.ended).subspan(ended)});
  }
  return taken;
}

bool Dispatcher::submit(FiringId firing, std::span<const Task> tasks, Nanos now, Starts& out) {
  const auto input = [&] {
    return DispatcherInput{
        .kind = DispatcherInput::Kind::kSubmit, .now = now_, .firing = firing, .tasks = tasks};
  };
  return take(now, out, input, [&] {
    if (!add(firing, tasks)) return false;
    counts_.submitted += static_cast<std::int64_t>(tasks.size());
    // A task may have been dropped with one before it.
    for (const TaskSlot each : doomed_) {
      if (tasks_[each].state == TaskState::kWaiting) drop(each, Ending::kDropped, out);
    }
    drop_unmet(out);
    expire(Expire::kBeforeNow, out);
    const bool alone = added_.size() == 1;
    for (const TaskSlot each : added_) {
      if (tasks_[each].state == TaskState::kWaiting && tasks_[each].pending == 0) {
        make_ready(each, alone);
      }
    }
    settle(out);
    return true;
  });
}

/// Registers the tasks and links them to those that they come after. False, and nothing changed, if
/// one makes no sense.
bool Dispatcher::add(FiringId firing, std::span<const Task> tasks) {
  const auto [place, is_new] = tasks_.open_firing(firing);
  if (place == kNoSlot) return false;
  added_.clear();
  doomed_.clear();
  bool good = true;
  for (const Task& task : tasks) {
    const bool sound =
        task.kind.eligible != 0 && (task.kind.eligible & ~all_) == 0 &&
        task.state.value_or(0) < kMaxStates && task.series.value_or(0) < kMaxSeries &&
        std::ranges::all_of(task.reads, [](SeriesId each) { return each < kMaxSeries; });
    const TaskSlot slot = sound ? tasks_.add(task.id, place) : kNoSlot;
    good = slot != kNoSlot;
    if (!good) break;
    added_.push_back(slot);
  }
  for (std::size_t i = 0; good && i < tasks.size(); ++i) good = link(added_[i], tasks[i]);
  if (!good) {
    for (const TaskSlot each : added_) tasks_.remove(each);
    if (is_new) tasks_.release(firing);
    return false;
  }
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    tasks_[added_[i]].class_index = class_of(tasks[i].kind);
    tasks_[added_[i]].rank = policy_->rank(tasks[i]);
    if (tasks[i].expires_at) {
      tasks_.tie(added_[i]).expires_at = tasks[i].expires_at;
      watch_expiry(added_[i], *tasks[i].expires_at);
    }
    await_earlier(added_[i], tasks[i]);
  }
  for (std::size_t i = 0; i < tasks.size(); ++i) join(added_[i], tasks[i]);
  return true;
}

/// Of tasks that are submitted together, none reads another: none has joined its series yet.
void Dispatcher::await_earlier(TaskSlot slot, const Task& task) {
  for (const SeriesId series : task.reads) {
    const TaskSlot newest = series < series_.size() ? series_[series] : kNoSlot;
    if (newest == kDoneSlot) continue;
    if (newest == kNoSlot) {
      unmet_.push_back({slot, tasks_[slot].generation});
    } else {
      tasks_.add_reader(newest, slot);
      ++tasks_[slot].pending;
    }
  }
}

/// The task is last of its state and newest of its series.
void Dispatcher::join(TaskSlot slot, const Task& task) {
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

void Dispatcher::leave_state(TaskSlot slot) {
  const TaskTies& ties = tasks_.ties(slot);
  StateQueue& queue = states_[ties.state];
  tasks_[slot].in_state = false;
  const auto [before, behind] = std::pair(ties.state_before, ties.state_behind);
  (before == kNoSlot ? queue.head : tasks_.ties(before).state_behind) = behind;
  (behind == kNoSlot ? queue.tail : tasks_.ties(behind).state_before) = before;
  if (before == kNoSlot && behind != kNoSlot) free_from_one(behind);
}

/// What reads the task has its data, or reads the next older one in its place.
void Dispatcher::decide(TaskSlot slot, bool completed) {
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
      unmet_.push_back({reader, tasks_[reader].generation});
    } else {
      tasks_.add_reader(stands, reader);
    }
  }
}

/// @param slot  Waits for one thing less. One that drop_successors is about to drop waits for none.
void Dispatcher::free_from_one(TaskSlot slot) {
  TaskRecord& record = tasks_[slot];
  if (record.pending != 0 && --record.pending == 0) freed_.push_back({slot, record.generation});
}

/// Each may leave others unmet.
void Dispatcher::drop_unmet(Starts& out) {
  for (std::size_t i = 0; i < unmet_.size(); ++i) {
    const auto [slot, generation] = unmet_[i];
    if (tasks_.is_current(slot, generation)) drop(slot, Ending::kNoPredecessor, out);
  }
  unmet_.clear();
}

/// False if the task comes after itself or one that is not linked yet.
bool Dispatcher::link(TaskSlot slot, const Task& task) {
  bool doomed = false;
  for (const TaskId id : task.after) {
    const TaskSlot predecessor = tasks_.find(id);
    if (predecessor == kNoSlot) continue;
    const TaskState state = tasks_[predecessor].state;
    if (state == TaskState::kNew) return false;
    if (is_over(state)) {
      doomed = true;
    } else {
      tasks_.add_successor(predecessor, slot);
      ++tasks_[slot].pending;
    }
  }
  tasks_[slot].state = TaskState::kWaiting;
  if (doomed) doomed_.push_back(slot);
  return true;
}

bool Dispatcher::release(FiringId firing, Nanos now) {
  const auto input = [&] {
    return DispatcherInput{.kind = DispatcherInput::Kind::kRelease, .now = now_, .firing = firing};
  };
  Starts none;
  return take(now, none, input, [&] { return tasks_.release(firing); });
}

bool Dispatcher::complete(UnitId unit, TaskId task, Outcome outcome, Nanos now, Starts& out) {
  const auto input = [&] {
    return DispatcherInput{.kind = DispatcherInput::Kind::kComplete,
                           .now = now_,
                           .task = task,
                           .unit = unit,
                           .outcome = outcome};
  };
  return take(now, out, input, [&] {
    const TaskSlot slot = tasks_.find(task);
    if (slot == kNoSlot || tasks_[slot].unit != unit) return false;
    const TaskState state = tasks_[slot].state;
    if (state != TaskState::kRunning && state != TaskState::kCancelled) return false;
    expire(Expire::kBeforeNow, out);
    --units_[unit].running;
    --load_[unit];
    if (state == TaskState::kRunning && outcome == Outcome::kCompleted) {
      ++counts_.completed;
      released_.clear();
      tasks_.successors(slot, released_);
      if (tasks_[slot].in_state) leave_state(slot);
      if (tasks_[slot].in_series) decide(slot, true);
      tasks_.remove(slot);
      refusals_stand_ = false;
      const bool alone = released_.size() == 1 && freed_.empty();
      for (const TaskSlot successor : released_) {
        if (--tasks_[successor].pending == 0) make_ready(successor, alone);
      }
    } else if (state == TaskState::kCancelled) {
      end(slot);
    } else if (outcome == Outcome::kReturned) {
      give_back(slot, unit, out);
    } else {
      fail(slot, out);
    }
    settle(out);
    return true;
  });
}

/// The task has failed, and was running.
void Dispatcher::fail(TaskSlot slot, Starts& out) {
  ++counts_.failed;
  drop_successors(slot, Ending::kDropped, out);
  end(slot);
}

/// The task waits for another unit, in the place in line that it had. A plan knows no other unit:
/// the policy takes it nowhere.
void Dispatcher::give_back(TaskSlot slot, UnitId unit, Starts& out) {
  ++counts_.returned;
  refusals_stand_ = false;
  TaskTies& ties = tasks_.tie(slot);
  ties.returned_by |= unit_bit(unit);
  TaskClass kind = classes_[tasks_[slot].class_index].kind;
  kind.eligible &= ~(ties.returned_by | gone_);
  if (++ties.returns == kMostTries || kind.eligible == 0 ||
      policy_->takers(kind, kind.eligible) == 0) {
    out.ended.push_back({tasks_[slot].id, Ending::kFailed});
    return fail(slot, out);
  }
  tasks_[slot].class_index = class_of(kind);
  hold(slot);
  if (!ties.expires_at) return;
  watch_expiry(slot, *ties.expires_at);
  expire(Expire::kBeforeNow, out);
}

void Dispatcher::cancel(TaskId task, Nanos now, Starts& out) {
  const auto input = [&] {
    return DispatcherInput{.kind = DispatcherInput::Kind::kCancel, .now = now_, .task = task};
  };
  take(now, out, input, [&] {
    expire(Expire::kBeforeNow, out);
    const TaskSlot slot = tasks_.find(task);
    if (slot != kNoSlot && tasks_[slot].state == TaskState::kRunning) {
      tasks_[slot].state = TaskState::kCancelled;
      count_drop(slot, Ending::kDropped, out);
      drop_successors(slot, Ending::kDropped, out);
      if (tasks_[slot].in_series) decide(slot, false);
    } else if (slot != kNoSlot && !is_over(tasks_[slot].state)) {
      drop(slot, Ending::kDropped, out);
    }
    settle(out);
    return true;
  });
}

bool Dispatcher::set_unit(UnitId unit, UnitState state, Nanos now, Starts& out) {
  const auto input = [&] {
    return DispatcherInput{
        .kind = DispatcherInput::Kind::kSetUnit, .now = now_, .unit = unit, .state = state};
  };
  return take(now, out, input, [&] {
    if (unit >= units_.size()) return false;
    expire(Expire::kBeforeNow, out);
    units_[unit].state = state;
    up_ = state == UnitState::kUp ? up_ | unit_bit(unit) : up_ & ~unit_bit(unit);
    gone_ = state == UnitState::kGone ? gone_ | unit_bit(unit) : gone_ & ~unit_bit(unit);
    for (auto& entry : classes_) entry.takers = policy_->takers(entry.kind, up_);
    if (state != UnitState::kUp) hand_on(unit);
    refusals_stand_ = false;
    settle(out);
    return true;
  });
}

void Dispatcher::wake(Nanos now, Starts& out) {
  const auto input = [&] {
    return DispatcherInput{.kind = DispatcherInput::Kind::kWake, .now = now_};
  };
  take(now, out, input, [&] {
    expire(Expire::kByNow, out);
    settle(out);
    return true;
  });
}

/// Ends what should have started by now, or before now.
void Dispatcher::expire(Expire which, Starts& out) {
  if (expiries_.empty()) return;
  tidy_expiries();
  while (!expiries_.empty() &&
         (which == Expire::kByNow ? expiries_.front().at <= now_ : expiries_.front().at < now_)) {
    const TaskSlot slot = expiries_.front().slot;
    ++counts_.expired;
    out.ended.push_back({tasks_[slot].id, Ending::kExpired});
    unlink(slot);
    drop_successors(slot, Ending::kDropped, out);
    end(slot);
    tidy_expiries();
  }
}

/// What waits in the unit's queue waits for others; if it is gone, all that it could have taken.
void Dispatcher::hand_on(UnitId unit) {
  std::vector<TaskSlot> waiting;
  const auto take = [&](TaskList& from) {
    while (!from.empty()) {
      waiting.push_back(from.front());
      unlink(from.front());
    }
  };
  take(units_[unit].queue);
  for (auto& entry : classes_) {
    if (!contains(entry.kind.eligible & gone_, unit)) continue;
    take(entry.held);
    take(entry.high_priority);
  }
  for (const TaskSlot slot : waiting) {
    leave_gone(slot);
    hold(slot);
  }
}

/// The task is of the class that does without the units that are gone, from now on.
void Dispatcher::leave_gone(TaskSlot slot) {
  TaskClass kind = classes_[tasks_[slot].class_index].kind;
  if ((kind.eligible & gone_) == 0) return;
  kind.eligible &= ~gone_;
  tasks_[slot].class_index = class_of(kind);
  classes_[tasks_[slot].class_index].hopeless = policy_->takers(kind, kind.eligible) == 0;
}

/// What waits for units that are gone for good.
void Dispatcher::fail_hopeless(Starts& out) {
  despair_ = false;
  for (auto& entry : classes_) {
    if (!entry.hopeless) continue;
    for (TaskList* list : {&entry.held, &entry.high_priority}) {
      while (!list->empty()) {
        const TaskSlot slot = list->front();
        unlink(slot);
        out.ended.push_back({tasks_[slot].id, Ending::kFailed});
        fail(slot, out);
      }
    }
  }
}

/// What every input but release ends with.
void Dispatcher::settle(Starts& out) {
  while (true) {
    drop_unmet(out);
    for (const auto& [slot, generation] : freed_) {
      if (!tasks_.is_current(slot, generation)) continue;
      if (tasks_[slot].state == TaskState::kWaiting && tasks_[slot].pending == 0) {
        make_ready(slot, false);
      }
    }
    freed_.clear();
    if (!despair_) break;
    fail_hopeless(out);  // Others may hold their states now, or have nothing to read.
  }
  place_held();
  start_all(out);
  if (!expiries_.empty()) tidy_expiries();
}

void Dispatcher::list_waiting(std::vector<int>& waiting) const {
  waiting.clear();
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    waiting.push_back(load_[unit] - units_[unit].running);
  }
  waiting.push_back(static_cast<int>(held_count_ + high_priority_count_));
}

std::optional<TaskState> Dispatcher::state(TaskId task) const {
  const TaskSlot slot = tasks_.find(task);
  if (slot == kNoSlot || tasks_[slot].state == TaskState::kEnded) return std::nullopt;
  return tasks_[slot].state;
}

/// A task graph has a class a task; elsewhere the same come again and again.
std::uint32_t Dispatcher::class_of(const TaskClass& kind) {
  if (last_class_ < classes_.size() && classes_[last_class_].kind == kind) return last_class_;
  const auto [found, is_new] =
      class_indices_.try_emplace(kind, static_cast<std::uint32_t>(classes_.size()));
  if (is_new) classes_.push_back({.kind = kind, .takers = policy_->takers(kind, up_)});
  return last_class_ = found->second;
}

/// The task waits for a unit from now on; place_held asks for it.
/// @param alone  No other becomes ready at once; without held ones it has none to compete with.
void Dispatcher::make_ready(TaskSlot slot, bool alone) {
  tasks_[slot].sequence = ready_sequence_++;
  tasks_[slot].ready_at = now_;
  leave_gone(slot);
  const bool hopeless = classes_[tasks_[slot].class_index].hopeless;
  if (!alone || hopeless || held_count_ != 0 || !place(slot)) hold(slot);
}

/// Asks the policy. False if it refuses; the task is then in no queue.
bool Dispatcher::place(TaskSlot slot) {
  TaskRecord& record = tasks_[slot];
  Class& entry = classes_[record.class_index];
  const Placement placement = policy_->place(entry.kind, view());
  switch (placement.kind) {
    case Placement::Kind::kHold:
      return false;
    case Placement::Kind::kHighPriority:
      record.state = TaskState::kHighPriority;
      entry.high_priority.insert(tasks_, slot);
      ++high_priority_count_;
      if (!std::exchange(entry.in_prioritized, true)) prioritized_.push_back(record.class_index);
      return true;
    case Placement::Kind::kUnit:
      assert(contains(entry.kind.eligible & up_, placement.unit));
      record.state = TaskState::kQueued;
      record.unit = placement.unit;
      record.dispatched_at = now_;
      units_[placement.unit].queue.insert(tasks_, slot);
      ++load_[placement.unit];
      return true;
  }
  return false;
}

void Dispatcher::hold(TaskSlot slot) {
  TaskRecord& record = tasks_[slot];
  Class& entry = classes_[record.class_index];
  record.state = TaskState::kHeld;
  entry.held.insert(tasks_, slot);
  ++held_count_;
  despair_ = despair_ || entry.hopeless;
  if (!std::exchange(entry.in_holding, true)) holding_.push_back(record.class_index);
}

/// Places what waits, in the order of all queues, until every class is refused: what has become
/// ready competes with what was held. Loads only rise meanwhile, so that a refusal stands.
void Dispatcher::place_held() {
  if (held_count_ == 0) return;
  asking_.clear();
  std::erase_if(holding_, [this](std::uint32_t index) {
    Class& entry = classes_[index];
    entry.refused = entry.refused && refusals_stand_ && !entry.held.empty();
    entry.in_holding = !entry.held.empty();
    if (entry.in_holding && !entry.refused) asking_.push_back(&entry);
    return !entry.in_holding;
  });
  refusals_stand_ = true;
  const auto later = [this](const Class* a, const Class* b) {
    return precedes(tasks_[b->held.front()], tasks_[a->held.front()]);
  };
  std::ranges::make_heap(asking_, later);
  while (!asking_.empty()) {
    std::ranges::pop_heap(asking_, later);
    Class& first = *asking_.back();
    const TaskSlot slot = first.held.front();
    unlink(slot);
    first.refused = !place(slot);
    if (first.refused) hold(slot);
    if (first.refused || first.held.empty()) {
      asking_.pop_back();
    } else {
      std::ranges::push_heap(asking_, later);
    }
  }
}

void Dispatcher::start_all(Starts& out) {
  for (const UnitId id : start_order_) {
    Unit& unit = units_[id];
    if (unit.state != UnitState::kUp) continue;
    while (unit.running < unit.slots) {
      TaskSlot slot = take_high_priority(id);
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
TaskSlot Dispatcher::take_high_priority(UnitId unit) {
  if (high_priority_count_ == 0) return kNoSlot;
  Class* oldest = nullptr;
  std::erase_if(prioritized_, [&](std::uint32_t index) {
    Class& entry = classes_[index];
    entry.in_prioritized = !entry.high_priority.empty();
    if (entry.in_prioritized && contains(entry.takers, unit) &&
        (oldest == nullptr ||
         precedes(tasks_[entry.high_priority.front()], tasks_[oldest->high_priority.front()]))) {
      oldest = &entry;
    }
    return !entry.in_prioritized;
  });
  if (oldest == nullptr) return kNoSlot;
  const TaskSlot slot = oldest->high_priority.front();
  unlink(slot);
  tasks_[slot].dispatched_at = now_;
  policy_->took(oldest->kind, unit, view());
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
    case TaskState::kNew:
    case TaskState::kWaiting:
    case TaskState::kRunning:
    case TaskState::kCancelled:
    case TaskState::kEnded:
      break;
  }
}

void Dispatcher::count_drop(TaskSlot slot, Ending how, Starts& out) {
  ++counts_.dropped;
  if (how == Ending::kNoPredecessor) ++counts_.no_predecessor;
  out.ended.push_back({tasks_[slot].id, how});
}

/// Drops a task that has not started, and its successors.
void Dispatcher::drop(TaskSlot slot, Ending how, Starts& out) {
  count_drop(slot, how, out);
  unlink(slot);
  drop_successors(slot, how, out);
  end(slot);
}

/// Successors of a task that did not complete; all of them still wait. Not recursive: a chain may
/// be long.
void Dispatcher::drop_successors(TaskSlot slot, Ending how, Starts& out) {
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
  if (state == TaskState::kWaiting || state == TaskState::kHeld) {
    policy_->gone(classes_[tasks_[slot].class_index].kind);
  }
  if (tasks_[slot].expires) --expiring_count_;
  if (tasks_[slot].in_state) leave_state(slot);
  if (tasks_[slot].in_series) decide(slot, false);
  tasks_.end(slot);
  refusals_stand_ = false;
}

void Dispatcher::watch_expiry(TaskSlot slot, Nanos at) {
  tasks_[slot].expires = true;
  ++expiring_count_;
  expiries_.push_back({at, expiry_sequence_++, slot, tasks_[slot].generation});
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
