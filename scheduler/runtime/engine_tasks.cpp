// What becomes of tasks, within the engine's turn.
#include <algorithm>
#include <array>
#include <stdexcept>

#include "characterize/platform/elsewhere.h"
#include "scheduler/runtime/engine.h"

namespace pirt {
namespace {

/// By TaskEnd: which count each is of.
constexpr std::array<std::int64_t RuntimeStatistics::*, kTaskEnds.size()> kCounts = {
    &RuntimeStatistics::completed, &RuntimeStatistics::failed,    &RuntimeStatistics::dropped,
    &RuntimeStatistics::expired,   &RuntimeStatistics::cancelled, &RuntimeStatistics::dropped};

}  // namespace

/// Whatever is thrown meanwhile (there may be no memory) ends this task, and no other.
void Runtime::Engine::take_event(Submitted& task) {
  if (task.event == Submitted::Event::kSliceEnded) return take_slice(task);
  const bool submits = task.event == Submitted::Event::kSubmit;
  const bool was_cancelled = !submits && task.is_decided();
  now_ = std::max(now_, submits ? task.submitted_at : task.call_end.at);
  try {
    if (submits) {
      take_in(task);
    } else {
      take_end(task);
    }
    apply();
  } catch (const std::exception& error) {
    const std::string problem = task.workload->name + ": " + error.what();
    add_problem(problem);
    if (!task.is_decided()) {
      task.problem = problem;
      if (task.taken_in) {
        finish(task, TaskEnd::kFailed);
      } else {
        decide(task, TaskEnd::kFailed);
        ended_.push(task);
      }
    }
  }
  // It has been told; the engine waited for the end of its call alone.
  if (was_cancelled && !task.known) TaskRef::let_go(task);
}

void Runtime::Engine::take_in(Submitted& task) {
  ++counts_.submitted;
  task.taken_in = true;
  hear_of_others();
  const Task given = dispatched(task);
  // First, since there may be no memory: a new slot is never beyond those in use.
  tasks_.resize(std::max(tasks_.size(), dispatcher_->known_tasks() + 1));
  const auto firing = dispatcher_->submit(std::span(&given, 1), now_, effects_);
  if (!firing) throw std::logic_error("the dispatcher refused a task of the runtime");
  task.firing = *firing;
  task.id = effects_.submitted.back();
  tasks_[slot_of(task.id)] = &task;
  task.known = true;
  if (trace_) trace_->submitted(task.id, task.workload_index, 0, ++number_);
  if (!closing_) return;
  // Who submitted it had not seen that. store(closing_) -> the turn of cancel_all; pairs with this
  // turn -> load(closing_): one of the two sees the task.
  const std::lock_guard lock(asking_);
  cancels_all_ = true;
  asked_.fetch_or(kLook);
}

/// The task as the dispatcher sees it.
Task Runtime::Engine::dispatched(const Submitted& task) {
  const Known& known = workloads_[task.workload_index];
  const Nanos now = task.submitted_at;
  after_.clear();
  visit_before(task, [&](const Submitted& before) {
    const int end = before.end.load(std::memory_order_relaxed);
    if (end == static_cast<int>(TaskEnd::kCompleted)) return;
    after_.push_back(end == Submitted::kLive ? before.id : kNoTask);
  });
  Task submitted;
  submitted.kind = setup_->scenario.classes[task.workload_index][0];
  const UnitMask willing = task.eligible & ~known.gave_up;
  submitted.kind.eligible = willing != 0 ? willing : task.eligible;
  submitted.kind.real_time = task.options.real_time;
  submitted.kind.image_input = task.options.image_input.value_or(known.takes_image);
  // Not before the begin, of which a trace knows nothing: it is over by now either way.
  const auto at = [now](Nanos after) { return std::max(Nanos::zero(), later_by(now, after)); };
  if (task.options.deadline) submitted.deadline = at(*task.options.deadline);
  if (task.options.expires) submitted.expires_at = at(*task.options.expires);
  if (submitted.deadline && known.lead && !submitted.kind.real_time) {
    submitted.recall = known.lead->recall(*submitted.deadline);
  }
  submitted.after = after_;
  submitted.state = known.state;
  return submitted;
}

void Runtime::Engine::take_end(Submitted& task) {
  count_running(task.unit, -1);
  task.running = false;
  Unit& unit = units_[task.unit];
  const CallEnd& end = task.call_end;
  const bool wanted = !task.is_decided();
  unit.busy += end.busy;
  unit.powered += end.powered(is_elsewhere(options_.platform.units[task.unit]));
  // Of one that is suspended it has been told.
  if (!std::exchange(task.suspended, false) && trace_) {
    trace_->departed(task.unit, slot_of(task.id));
  }
  if (!end.problem.empty()) add_problem(end.problem);
  if (wanted) {
    task.busy = end.busy;
    task.problem = end.problem;
  }
  dispatcher_->complete(task.unit, task.id, end.outcome, now_, effects_);
  count_returns(task);
  if (!wanted) return forget(task);  // Cancelled as it ran.
  if (end.outcome == Outcome::kReturned) return;
  if (end.outcome != Outcome::kCompleted) return finish(task, TaskEnd::kFailed);
  task.call.commit(end);
  ++unit.completed;
  unit.latency.add(std::max(now_ - task.dispatched_at, Nanos::zero()));
  finish(task, TaskEnd::kCompleted);
}

void Runtime::Engine::count_running(UnitId id, int more) {
  Unit& unit = units_[id];
  running_ += more;
  unit.running += more;
  with_room_ = unit.running < unit.slots ? with_room_ | unit_bit(id) : with_room_ & ~unit_bit(id);
}

/// Its unit's thread waits: it goes on, or with what is let in.
void Runtime::Engine::take_slice(Submitted& task) {
  const UnitId unit = task.unit;
  now_ = std::max(now_, task.call_end.at);
  bool suspends = false;
  try {
    dispatcher_->slice_ended(unit, task.id, now_, effects_);
    suspends = !effects_.suspended.empty();
    task.suspended = suspends;
    if (suspends && trace_) trace_->departed(unit, slot_of(task.id));
    apply();
  } catch (const std::exception& error) {
    add_problem(task.workload->name + ": " + error.what());
  }
  if (!suspends) live_units_.go_on(unit);  // From now on the record may be posted again.
}

void Runtime::Engine::cancel_asked() {
  std::vector<TaskRef> cancels;
  {
    const std::lock_guard lock(asking_);
    std::swap(cancels, cancels_);
    if (std::exchange(cancels_all_, false)) {
      for (Submitted* const each : tasks_) {
        if (each == nullptr) continue;
        TaskRef::hold(*each);
        cancels.emplace_back(*each);
      }
    }
  }
  for (const TaskRef& task : cancels) {
    if (task->is_decided()) continue;
    if (!task->taken_in) {  // It was submitted after this turn began.
      const std::lock_guard lock(asking_);
      cancels_.push_back(task);
      asked_.fetch_or(kLook);
      continue;
    }
    // First, so that the dispatcher's word for it, dropped, is not taken.
    const TaskId id = task->id;
    finish(*task, TaskEnd::kCancelled);
    dispatcher_->cancel(id, now_, effects_);
    apply();
    if (task->running) {
      live_units_.request_stop(task->unit, task->call);
    } else {
      forget(*task);
      TaskRef::let_go(*task);
    }
  }
}

/// The first of those that the task comes after and that did not complete, in its own words.
std::string Runtime::Engine::why_dropped(const Submitted& task) {
  static constexpr std::string_view kSince = ": dropped, since ";
  std::string why;
  visit_before(task, [&](const Submitted& before) {
    if (!why.empty() || !before.is_decided()) return;
    const auto end = static_cast<TaskEnd>(before.end.load());
    if (end == TaskEnd::kCompleted) return;
    std::string first =
        before.problem.empty()
            ? before.workload->name + " before it has ended as " + std::string(to_string(end))
            : before.problem;
    if (const auto since = first.find(kSince); since != std::string::npos) {
      first.erase(0, since + kSince.size());
    }
    why = task.workload->name + std::string(kSince) + first;
  });
  return why;
}

/// Carries out what the dispatcher has decided.
void Runtime::Engine::apply() {
  std::swap(effects_, applied_);
  for (const Start& each : applied_.started) start(each);
  for (const Sliced& each : applied_.resumed) {
    if (Submitted* const task = task_of(each.task)) {
      task->suspended = false;
      note_arrival(*task);
    }
    live_units_.go_on(each.unit);
  }
  for (const Recalled& each : applied_.recalled) {
    Submitted* const task = task_of(each.task);
    if (task != nullptr && task->running) live_units_.request_stop(each.unit, task->call);
  }
  for (const Ended& each : applied_.ended) {
    Submitted* const task = task_of(each.task);
    if (task == nullptr || task->is_decided()) continue;
    if (each.how == TaskEnd::kFailed && task->problem.empty()) {
      task->problem = task->workload->name + ": no unit is left that could run it";
    }
    if (each.how == TaskEnd::kDropped) task->problem = why_dropped(*task);
    finish(*task, each.how);
  }
  applied_.clear();
}

void Runtime::Engine::start(const Start& start) {
  Submitted& task = *task_of(start.task);
  task.unit = start.unit;
  task.dispatched_at = start.dispatched_at;
  task.started_at = now_;
  task.unit_name = options_.platform.units[start.unit].name;
  task.running = true;
  // Later calls are looked at when this one is.
  if (running_ == 0) look_at_ = later_by(now_, live_units_.look_every());
  count_running(start.unit, 1);
  note_arrival(task);
  try {
    fill_call(task);
    live_units_.run(start.unit, task.call, start.let_in);
  } catch (const std::exception& error) {  // No memory for what it makes.
    task.call_end = {
        .outcome = Outcome::kFailed,
        .problem = task.workload->name + " on " + task.unit_name + ": " + error.what()};
    post(ended_calls_, task, Submitted::Event::kEnd);
  }
}

void Runtime::Engine::note_arrival(const Submitted& task) {
  if (!trace_) return;
  trace_->arrived(task.unit, slot_of(task.id), options_.platform.units[task.unit].active_w);
}

void Runtime::Engine::fill_call(Submitted& task) {
  Call& call = task.call;
  live_units_.fill(task.unit, call, *task.workload, workloads_[task.workload_index].state,
                   dispatcher_->recall(task.id), began_);
  call.token = reinterpret_cast<std::uintptr_t>(&task);
  call.inputs.reserve(task.inputs.size());
  for (const TaskInput& input : task.inputs) {
    const TaskOutput& output = input.output_;
    call.inputs.push_back(output.task ? (*output.task->call.outputs)[output.index].share()
                                      : input.tensor_.share());
  }
}

/// How it ends is known, and counted. Its future says so before what comes after it can begin,
/// whoever tells of that first.
void Runtime::Engine::decide(Submitted& task, TaskEnd end) {
  task.ended_at = now_;
  if (end != TaskEnd::kCompleted) {
    task.name = task.workload->name;
    some_did_not_complete_ = true;
  }
  task.end.store(static_cast<int>(end), std::memory_order_release);
  const auto& deadline = task.options.deadline;
  if (deadline && now_ > later_by(task.submitted_at, *deadline)) ++counts_.late;
  ++(counts_.*kCounts.at(static_cast<std::size_t>(end)));
}

/// It is told when the turn is over. Whoever cancels it forgets it, at once or when its call ends.
void Runtime::Engine::finish(Submitted& task, TaskEnd end) {
  decide(task, end);
  const bool stays = task.running || end == TaskEnd::kCancelled;
  if (stays) TaskRef::hold(task);
  ended_.push(task);
  if (!stays) forget(task);
}

/// The dispatcher and the engine know it no more.
void Runtime::Engine::forget(Submitted& task) {
  if (std::exchange(task.known, false)) {
    dispatcher_->release(task.firing, now_);
    tasks_[slot_of(task.id)] = nullptr;
  }
}

}  // namespace pirt
