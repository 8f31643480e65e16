// What becomes of tasks, within the engine's turn.
#include <algorithm>
#include <stdexcept>

#include "characterize/platform/elsewhere.h"
#include "scheduler/runtime/engine.h"

namespace pirt {

/// Whatever is thrown meanwhile (there may be no memory) ends this task, and no other.
void Runtime::Engine::take_event(Submitted& task, Nanos now) {
  // Who has ended is told, and may then be gone.
  const auto kept = task.event == Submitted::Event::kSubmit
                        ? task.self
                        : tasks_[static_cast<std::uint32_t>(task.id)];
  try {
    if (task.event == Submitted::Event::kSubmit) {
      take_in(task, now);
    } else {
      take_end(task, now);
    }
    apply(now);
  } catch (const std::exception& error) {
    task.problem = task.workload->name + ": " + error.what();
    add_problem(task.problem);
    if (!task.ends && task.taken_in) {
      finish(task, TaskEnd::kFailed, now);
    } else if (!task.ends) {
      task.ends = TaskEnd::kFailed;
      task.name = task.workload->name;
      ++counts_.failed;
      ended_.push_back(kept);
    }
  }
}

void Runtime::Engine::take_in(Submitted& task, Nanos now) {
  ++counts_.submitted;
  const Slot slot = tasks_.take();
  tasks_[slot] = std::move(task.self);
  task.id = TaskId{number_++} << 32 | slot;
  task.taken_in = true;
  const Task submitted = dispatched(task);
  task.recall = submitted.recall;
  if (trace_) trace_->submitting(task.id, task.workload_index, 0, number_);
  if (!dispatcher_->submit(task.id, std::span(&submitted, 1), now, effects_)) {
    throw std::logic_error("the dispatcher refused a task of the runtime");
  }
  task.known = true;
}

/// The task as the dispatcher sees it.
Task Runtime::Engine::dispatched(const Submitted& task) {
  const Known& known = workloads_[task.workload_index];
  const Nanos now = task.submitted_at;
  after_.clear();
  bool doomed = false;
  const auto follow = [&](const Submitted* before) {
    if (before == nullptr || before->ends == TaskEnd::kCompleted) return;
    doomed = doomed || before->ends.has_value();
    after_.push_back(before->id);
  };
  for (const TaskInput& input : task.inputs) follow(input.output_.task.get());
  for (const TaskFuture& before : task.options.after) follow(before.task_.get());
  if (doomed) after_.push_back(never(this->now()));
  Task submitted;
  submitted.id = task.id;
  submitted.kind = setup_->scenario.classes[task.workload_index][0];
  const UnitMask willing = task.eligible & ~known.gave_up;
  submitted.kind.eligible = willing != 0 ? willing : task.eligible;
  submitted.kind.real_time = task.options.real_time;
  submitted.kind.image_input = task.options.image_input.value_or(known.takes_image);
  if (task.options.deadline) submitted.deadline = later_by(now, *task.options.deadline);
  if (task.options.expires) submitted.expires_at = later_by(now, *task.options.expires);
  if (submitted.deadline && known.lead && !submitted.kind.real_time) {
    submitted.recall = known.lead->recall(*submitted.deadline);
  }
  submitted.after = after_;
  submitted.state = known.state;
  return submitted;
}

/// A task that has not completed, and is known for good: the dispatcher drops what comes after it.
TaskId Runtime::Engine::never(Nanos now) {
  if (!never_) {
    never_ = ~TaskId{0};
    Task task;
    task.id = *never_;
    task.kind = setup_->scenario.classes[0][0];
    task.expires_at = now - Nanos(1);  // Over before it could start.
    if (trace_) trace_->submitting(*never_, 0, 0, 0);
    dispatcher_->submit(*never_, std::span(&task, 1), now, effects_);
  }
  return *never_;
}

void Runtime::Engine::take_end(Submitted& task, Nanos now) {
  --running_;
  task.running = false;
  Unit& unit = units_[task.unit];
  const CallEnd& end = task.call_end;
  unit.busy += end.busy;
  unit.powered += end.powered(is_elsewhere(options_.platform.units[task.unit]));
  if (!task.ends) task.busy = end.busy;
  if (trace_) trace_->left(task.unit, static_cast<std::uint32_t>(task.id));
  if (!end.problem.empty()) add_problem(end.problem);
  if (!task.ends) task.problem = end.problem;
  dispatcher_->complete(task.unit, task.id, end.outcome, now, effects_);
  count_returns(task, now);
  if (end.outcome == Outcome::kReturned) {
    if (task.ends) forget(task, now);
    return;
  }
  const auto& state = workloads_[task.workload_index].state;
  if (!task.ends && end.outcome == Outcome::kCompleted && state) {
    states_[*state]->commit(end.version);
  }
  if (task.ends) return forget(task, now);  // Cancelled as it ran.
  if (end.outcome == Outcome::kCompleted) {
    ++unit.completed;
    unit.latency.add(std::max(now - task.dispatched_at, Nanos::zero()));
  }
  finish(task, end.outcome == Outcome::kCompleted ? TaskEnd::kCompleted : TaskEnd::kFailed, now);
}

void Runtime::Engine::cancel_asked(Nanos now) {
  Tasks cancels;
  {
    const std::lock_guard lock(asking_);
    std::swap(cancels, cancels_);
    if (std::exchange(cancels_all_, false)) cancels = tasks_.records();
  }
  for (const auto& task : cancels) {
    if (task == nullptr || task->ends) continue;
    if (!task->taken_in) {  // It was submitted after this turn began.
      const std::lock_guard lock(asking_);
      cancels_.push_back(task);
      asked_ = true;
      continue;
    }
    // First, so that the dispatcher's word for it, dropped, is not taken.
    const TaskId id = task->id;
    finish(*task, TaskEnd::kCancelled, now);
    dispatcher_->cancel(id, now, effects_);
    apply(now);
    if (task->running) {
      request_stop(*task);
    } else {
      forget(*task, now);
    }
  }
}

/// Carries out what the dispatcher has decided.
void Runtime::Engine::apply(Nanos now) {
  std::swap(effects_, applied_);
  for (const Start& each : applied_.started) start(each);
  for (const Recalled& each : applied_.recalled) {
    const auto& task = tasks_[static_cast<std::uint32_t>(each.task)];
    if (task != nullptr && task->id == each.task && task->running) request_stop(*task);
  }
  for (const Ended& each : applied_.ended) {
    if (each.task == never_) continue;
    const auto& task = tasks_[static_cast<std::uint32_t>(each.task)];
    if (task == nullptr || task->id != each.task || task->ends) continue;
    if (each.how == TaskEnd::kFailed && task->problem.empty()) {
      task->problem = task->workload->name + ": no unit is left that could run it";
    }
    finish(*task, each.how, now);
  }
  applied_.clear();
}

/// Of one that runs.
void Runtime::Engine::request_stop(Submitted& task) {
  live_units_.request_stop(task.unit, task.call);
}

void Runtime::Engine::start(const Start& start) {
  Submitted& task = task_of(start.task);
  task.unit = start.unit;
  task.dispatched_at = start.dispatched_at;
  task.started_at = now();
  task.unit_name = options_.platform.units[start.unit].name;
  task.running = true;
  ++running_;
  if (trace_) {
    trace_->arrived(start.unit, static_cast<std::uint32_t>(start.task),
                    options_.platform.units[start.unit].active_w);
  }
  try {
    fill_call(task);
    live_units_.run(start.unit, task.call);
  } catch (const std::exception& error) {  // No memory for what it makes.
    task.call_end = {
        .outcome = Outcome::kFailed,
        .problem = task.workload->name + " on " + task.unit_name + ": " + error.what()};
    post(task, Submitted::Event::kEnd);
  }
}

void Runtime::Engine::fill_call(Submitted& task) {
  Call& call = task.call;
  const auto& state = workloads_[task.workload_index].state;
  call.workload = task.workload;
  if (!task.workload->outputs.empty()) call.outputs = pool_.take(*task.workload);
  if (state) call.state = states_[*state];
  call.token = reinterpret_cast<std::uintptr_t>(&task);
  call.unwanted = false;
  call.wanted_until.reset();
  if (task.recall && contains(task.recall->from, task.unit)) {
    call.wanted_until = began_ + task.recall->at;
  }
  call.inputs.clear();
  call.inputs.reserve(task.inputs.size());
  for (const TaskInput& input : task.inputs) {
    const TaskOutput& output = input.output_;
    call.inputs.push_back(output.task ? (*output.task->call.outputs)[output.index].share()
                                      : input.tensor_.share());
  }
}

void Runtime::Engine::finish(Submitted& task, TaskEnd end, Nanos now) {
  task.ends = end;
  task.ended_at = now;
  if (end != TaskEnd::kCompleted) task.name = task.workload->name;
  const auto& deadline = task.options.deadline;
  if (deadline && now > later_by(task.submitted_at, *deadline)) ++counts_.late;
  switch (end) {
    case TaskEnd::kCompleted:
      ++counts_.completed;
      break;
    case TaskEnd::kFailed:
      ++counts_.failed;
      break;
    case TaskEnd::kDropped:
    case TaskEnd::kNoPredecessor:
      ++counts_.dropped;
      break;
    case TaskEnd::kExpired:
      ++counts_.expired;
      break;
    case TaskEnd::kCancelled:
      ++counts_.cancelled;
      break;
  }
  ended_.push_back(tasks_[static_cast<std::uint32_t>(task.id)]);
  if (!task.running && end != TaskEnd::kCancelled) forget(task, now);
}

/// Nothing refers to its slot any more.
void Runtime::Engine::forget(Submitted& task, Nanos now) {
  if (task.known) dispatcher_->release(task.id, now);
  const auto slot = static_cast<std::uint32_t>(task.id);
  task.inputs.clear();
  task.options.after.clear();
  tasks_[slot] = nullptr;
  tasks_.give_back(slot);
}

}  // namespace pirt
