#include "scheduler/runtime/engine.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr Nanos kLook = std::chrono::milliseconds(50);
/// In a row, of a thread that only wanted to submit: then the runtime's own goes on.
constexpr int kMostTurns = 4;

}  // namespace

thread_local bool runtime::MustNotWait::here_ = false;

void runtime::MustNotWait::check(const char* what) {
  if (!here_) return;
  throw std::logic_error(std::string(what) +
                         " in a callback or a kernel would wait for itself; submit what comes "
                         "next with `after` instead");
}

Runtime::Engine::~Engine() {
  if (runtime::MustNotWait::here()) {
    std::fputs(
        "pirt: a Runtime ends in a callback or a kernel of its own, and would wait for itself\n",
        stderr);
    std::abort();
  }
  closing_ = true;
  cancel_all();
  wait_until(0);
  // Calls that were cancelled as they ran still do, unless they are lost.
  {
    std::unique_lock lock(waiting_mutex_);
    ++waiting_;
    fewer_.wait(lock, [this] { return !calls_run_; });
    --waiting_;
  }
  watcher_ = {};
  // Who is about to look once more finds it taken.
  turn_.take().keep_for_good();
  live_units_.close();
}

std::size_t Runtime::Engine::find(std::string_view workload) const {
  const auto known = names_.find(workload);
  if (known != names_.end()) return known->second;
  std::vector<std::string> names;
  for (const auto& [name, index] : names_) names.push_back(name);
  throw_bad_input("'" + std::string(workload) + "' is none of the runtime's workloads" +
                  suggestion(std::string(workload), names) + "; name it in its options");
}

void Runtime::Engine::check_inputs(const Workload& workload,
                                   const std::vector<TaskInput>& inputs) const {
  if (inputs.size() != workload.inputs.size()) {
    throw_bad_input(workload.name + " takes " + std::to_string(workload.inputs.size()) +
                    " inputs, not " + std::to_string(inputs.size()));
  }
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const TaskOutput& output = inputs[i].output_;
    const TensorSpec* given = &inputs[i].tensor_.spec();
    if (output.task != nullptr) {
      // Of another one the workload may be gone.
      const bool ours = output.task->engine == number_of_engine_;
      if (!ours || output.index >= output.task->workload->outputs.size()) {
        throw_bad_input(workload.name + ": input " + workload.inputs[i].name +
                        " is of a task of another runtime, or an output that is not there");
      }
      const auto& outputs = output.task->workload->outputs;
      given = &outputs[output.index];
    }
    const TensorSpec& wanted = workload.inputs[i];
    if (given->element != wanted.element || given->shape != wanted.shape ||
        given->varies != wanted.varies) {
      throw_bad_input(workload.name + " takes " + wanted.describe() + ", not " + given->describe());
    }
  }
}

UnitMask Runtime::Engine::units_named(const std::vector<std::string>& names) const {
  if (names.empty()) return ~UnitMask{0};
  UnitMask mask = 0;
  for (const std::string& name : names) {
    const UnitModel& unit = options_.platform.unit(name);
    mask |= unit_bit(static_cast<UnitId>(&unit - options_.platform.units.data()));
  }
  return mask;
}

TaskFuture Runtime::Engine::submit(std::string_view workload, std::vector<TaskInput> inputs,
                                   TaskOptions options, Callback callback) {
  const std::size_t index = find(workload);
  const Known& known = workloads_[index];
  check_inputs(*known.workload, inputs);
  for (const TaskFuture& before : options.after) {
    if (before.valid() && before.task_->engine == number_of_engine_) continue;
    throw_bad_input(known.workload->name + ": one of `after` is no task of this runtime");
  }
  const UnitMask eligible = known.runs_on & units_named(options.eligible);
  if (eligible == 0) {
    throw_bad_input(known.workload->name + ": none of the units " + join(options.eligible, ", ") +
                    " can run it; leave `eligible` out, or name one of " +
                    unit_list(options_.platform, known.runs_on));
  }
  if (closing_) {
    throw_environment(known.workload->name + ": the runtime is ending and takes nothing new");
  }
  if (live_.fetch_add(1) >= options_.most_tasks && !runtime::MustNotWait::here()) {
    live_.fetch_sub(1);
    wait_until(resume_at_);
    live_.fetch_add(1);
  }
  auto task = std::make_shared<Submitted>();
  task->engine = number_of_engine_;
  task->workload = known.workload;
  task->workload_index = index;
  task->eligible = eligible;
  task->inputs = std::move(inputs);
  task->options = std::move(options);
  task->callback = std::move(callback);
  task->submitted_at = now();
  task->self = task;
  post(*task, Submitted::Event::kSubmit);
  work(Thread::kTheirs);
  return TaskFuture(std::move(task));
}

void Runtime::Engine::cancel(const TaskFuture& task) {
  if (!task.valid() || task.task_->engine != number_of_engine_) {
    throw_bad_input("cancel: the task is none of this runtime");
  }
  {
    const std::lock_guard lock(asking_);
    cancels_.push_back(task.task_);
  }
  asked_ = true;
  work(Thread::kTheirs);
}

void Runtime::Engine::cancel_all() {
  {
    const std::lock_guard lock(asking_);
    cancels_all_ = true;
  }
  asked_ = true;
  work(Thread::kTheirs);
}

/// Until at most so many tasks have not ended.
void Runtime::Engine::wait_until(std::size_t most) {
  runtime::MustNotWait::check("waiting for tasks");
  std::unique_lock lock(waiting_mutex_);
  std::atomic<int>& waiting = most == 0 ? waiting_ : waiting_for_room_;
  ++waiting;
  fewer_.wait(lock, [&] { return live_ <= most; });
  --waiting;
}

void Runtime::Engine::wait_all() { wait_until(0); }

RuntimeStatistics Runtime::Engine::statistics() {
  auto turn = turn_.take();
  RuntimeStatistics statistics = counts_;
  statistics.problems = problems_.first();
  statistics.returned = dispatcher_->counts().returned;
  statistics.set_up = set_up_;
  statistics.live = statistics.submitted - statistics.completed - statistics.failed -
                    statistics.dropped - statistics.expired - statistics.cancelled;
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    const Unit& each = units_[unit];
    if (!live_units_.has(unit)) continue;
    statistics.units.push_back({.name = options_.platform.units[unit].name,
                                .in_service = each.in_service,
                                .completed = each.completed,
                                .busy = each.busy,
                                .latency = each.latency});
  }
  turn.give_back();
  work(Thread::kTheirs);  // What was left to who had the turn.
  return statistics;
}

std::vector<Tensor> Runtime::Engine::state(std::string_view name) {
  const auto known = state_names_.find(name);
  if (known == state_names_.end()) {
    throw_bad_input("no workload of this runtime has a state '" + std::string(name) + "'");
  }
  auto turn = turn_.take();
  auto copy = copy_tensors(states_[known->second]->committed());
  turn.give_back();
  work(Thread::kTheirs);
  return copy;
}

void Runtime::Engine::write_trace() {
  if (trace_ == nullptr) throw_bad_input("write_trace: the runtime's options name no trace");
  wait_all();
  auto turn = turn_.take();
  const auto trace = std::move(trace_);
  dispatcher_->observe(nullptr);
  turn.give_back();
  work(Thread::kTheirs);
  Tally tally;
  tally.end = now();
  trace->finish();
  writer_->finish(tally);
}

void Runtime::Engine::post(Submitted& task, Submitted::Event event) {
  task.event = event;
  task.next = posted_.load(std::memory_order_relaxed);
  while (!posted_.compare_exchange_weak(task.next, &task)) continue;
}

void Runtime::Engine::work(Thread thread) {
  Tasks ended;
  for (int turns = 0; has_work(); ++turns) {
    if (turns == kMostTurns && thread == Thread::kTheirs) {
      wake_watcher();
      break;
    }
    // Who has it looks again after it has given it back.
    auto turn = turn_.try_take();
    if (!turn) break;
    take_turn();
    end_turn(turn, ended);
  }
  tell(ended, thread);
}

void Runtime::Engine::end_turn(runtime::Turn::Held& turn, Tasks& ended) {
  if (ended.empty()) {
    std::swap(ended, ended_);
  } else {
    std::ranges::move(ended_, std::back_inserter(ended));
    ended_.clear();
  }
  const Nanos wake = dispatcher_->next_wake();
  const bool idle = running_ == 0;
  calls_run_ = !idle;
  turn.give_back();
  if (idle && waiting_ > 0) {
    const std::lock_guard lock(waiting_mutex_);
    fewer_.notify_all();
  }
  // It looks after calls that hang, and at what time brings.
  if (wake != Nanos::max() || (!idle && watcher_rests_)) {
    const std::lock_guard lock(watch_mutex_);
    if (wake < watch_at_ || watcher_rests_) {
      watch_at_ = std::min(watch_at_, wake);
      watcher_rests_ = false;
      watch_sooner_.notify_one();
    }
  }
}

void Runtime::Engine::take_turn() {
  const Nanos now = this->now();
  Submitted* newest = posted_.exchange(nullptr);
  Submitted* oldest = nullptr;
  while (newest != nullptr) {
    Submitted* before = newest->next;
    newest->next = oldest;
    oldest = newest;
    newest = before;
  }
  while (oldest != nullptr) {
    Submitted& task = *oldest;
    oldest = task.next;
    take_event(task, now);
  }
  if (asked_.exchange(false)) {
    cancel_asked(now);
    look(now);
    apply(now);
  }
  if (!trace_) return;
  dispatcher_->list_waiting(queued_);
  trace_->settled(now, queued_);
}

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
  if (free_.empty()) {
    free_.push_back(static_cast<std::uint32_t>(tasks_.size()));
    tasks_.emplace_back();
  }
  const std::uint32_t slot = free_.back();
  free_.pop_back();
  tasks_[slot] = std::move(task.self);
  task.id = TaskId{number_++} << 32 | slot;
  task.taken_in = true;
  const Task submitted = dispatched(task);
  if (trace_) trace_->submitting(task.id, task.workload_index, 0, number_);
  if (!dispatcher_->submit(task.id, std::span(&submitted, 1), now, starts_)) {
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
    dispatcher_->submit(*never_, std::span(&task, 1), now, starts_);
  }
  return *never_;
}

void Runtime::Engine::take_end(Submitted& task, Nanos now) {
  --running_;
  task.running = false;
  Unit& unit = units_[task.unit];
  const CallEnd& end = task.call_end;
  unit.busy += end.busy;
  if (!task.ends) task.busy = end.busy;
  if (trace_) trace_->left(task.unit, static_cast<std::uint32_t>(task.id));
  if (!end.problem.empty()) add_problem(end.problem);
  if (!task.ends) task.problem = end.problem;
  dispatcher_->complete(task.unit, task.id, end.outcome, now, starts_);
  count_returns(task, end.outcome, now);
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

/// A unit that cannot run one workload may well run others.
void Runtime::Engine::count_returns(const Submitted& task, Outcome outcome, Nanos now) {
  const auto workload = static_cast<WorkloadId>(task.workload_index);
  const int returns = live_units_.count_returns(task.unit, workload, outcome);
  Known& known = workloads_[task.workload_index];
  if (returns < LiveUnits::kMostReturns || contains(known.gave_up, task.unit)) return;
  known.gave_up |= unit_bit(task.unit);
  add_problem("unit " + options_.platform.units[task.unit].name + " is not asked for " +
              known.workload->name + " any more: it gave back " + std::to_string(returns) +
              " calls one after the other");
  const bool asked_for_any = std::ranges::any_of(workloads_, [&](const Known& each) {
    return contains(each.runs_on & ~each.gave_up, task.unit);
  });
  if (!asked_for_any) lose(task.unit, now);
}

/// Nothing runs there any more.
void Runtime::Engine::lose(UnitId unit, Nanos now) {
  units_[unit].in_service = false;
  dispatcher_->set_unit(unit, UnitState::kGone, now, starts_);
}

/// What time has brought: tasks that were to start by now, and calls that do not end.
void Runtime::Engine::look(Nanos now) {
  dispatcher_->wake(now, starts_);
  apply(now);
  const auto all = live_units_.abandon_hung(
      [this](UnitId unit, std::uint64_t token) { return expected(unit, token); });
  // All of them first: nothing of one may start on another.
  for (const LiveUnits::Hung& hung : all) lose(hung.unit, now);
  for (const LiveUnits::Hung& hung : all) give_up(hung, now);
}

const Service* Runtime::Engine::expected(UnitId unit, std::uint64_t token) {
  const std::size_t index = task_at(token).workload_index;
  const OwnWorkload* own = workloads_[index].own;
  const bool known = own != nullptr ? own->expected.contains(options_.platform.units[unit].name)
                                    : options_.profile.has_value();
  if (!known) return nullptr;
  return setup_->scenario.services.find(static_cast<WorkloadId>(index), unit);
}

/// The call never comes back to anybody. What it reads and writes is its own from then on.
void Runtime::Engine::give_up(const LiveUnits::Hung& hung, Nanos now) {
  const Submitted& task = task_at(hung.token);
  if (const auto& id = workloads_[task.workload_index].state) {
    states_[*id] = std::make_shared<StateValue>(*states_[*id]);
  }
  const std::string problem =
      overdue(task.workload->name, options_.platform.units[hung.unit].name, hung.ran);
  const auto give_end = [&](std::uint64_t token, CallEnd end) {
    Submitted& each = task_at(token);
    each.call_end = std::move(end);
    each.event = Submitted::Event::kEnd;
    take_event(each, now);
  };
  give_end(hung.token, {.outcome = Outcome::kFailed, .busy = hung.ran, .problem = problem});
  for (const std::uint64_t token : hung.behind) give_end(token, {.outcome = Outcome::kReturned});
}

void Runtime::Engine::cancel_asked(Nanos now) {
  Tasks cancels;
  {
    const std::lock_guard lock(asking_);
    std::swap(cancels, cancels_);
    if (std::exchange(cancels_all_, false)) cancels = tasks_;
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
    dispatcher_->cancel(id, now, starts_);
    apply(now);
    if (!task->running) forget(*task, now);
  }
}

/// Carries out what the dispatcher has decided.
void Runtime::Engine::apply(Nanos now) {
  std::swap(starts_, applied_);
  for (const Start& each : applied_.started) start(each);
  for (const Ended& each : applied_.ended) {
    if (each.task == never_) continue;
    const auto& task = tasks_[static_cast<std::uint32_t>(each.task)];
    if (task == nullptr || task->id != each.task || task->ends) continue;
    switch (each.how) {
      case Ending::kExpired:
        finish(*task, TaskEnd::kExpired, now);
        break;
      case Ending::kFailed:
        if (task->problem.empty()) {
          task->problem = task->workload->name + ": no unit is left that could run it";
        }
        finish(*task, TaskEnd::kFailed, now);
        break;
      default:
        finish(*task, TaskEnd::kDropped, now);
    }
  }
  applied_.clear();
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
    live_units_.run(start.unit, call_of(task));
  } catch (const std::exception& error) {  // No memory for what it makes.
    task.call_end = {
        .outcome = Outcome::kFailed,
        .problem = task.workload->name + " on " + task.unit_name + ": " + error.what()};
    post(task, Submitted::Event::kEnd);
  }
}

Call Runtime::Engine::call_of(Submitted& task) {
  task.outputs = task.workload->outputs.empty() ? nothing_ : pool_.take(*task.workload);
  const auto& state = workloads_[task.workload_index].state;
  Call call{.workload = task.workload,
            .inputs = {},
            .outputs = task.outputs,
            .state = state ? states_[*state] : nullptr,
            .token = reinterpret_cast<std::uintptr_t>(&task)};
  call.inputs.reserve(task.inputs.size());
  for (const TaskInput& input : task.inputs) {
    const TaskOutput& output = input.output_;
    call.inputs.push_back(output.task ? (*output.task->outputs)[output.index].share()
                                      : input.tensor_.share());
  }
  return call;
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
  free_.push_back(slot);
  tasks_[slot] = nullptr;
}

void Runtime::Engine::add_problem(std::string problem) {
  if (options_.problem) {
    const std::lock_guard lock(telling_);
    to_say_.push_back(problem);
    anything_left_ = true;
  }
  problems_.add(std::move(problem));
}

/// Without the turn: callbacks may submit.
void Runtime::Engine::tell(Tasks& ended, Thread thread) {
  const bool ours = thread == Thread::kOurs;
  bool left = false;
  for (auto& task : ended) {
    task->end.store(static_cast<int>(*task->ends), std::memory_order_release);
    if (!task->callback) {
      told(std::move(task));
    } else if (ours) {
      call_back(std::move(task));
    } else {
      const std::lock_guard lock(telling_);
      to_tell_.push_back(std::move(task));
      left = anything_left_ = true;
    }
  }
  if (ours && anything_left_) tell_left();
  if (!ours && (left || anything_left_)) wake_watcher();
}

/// What ended in the turn of somebody else's thread, and problems.
void Runtime::Engine::tell_left() {
  while (anything_left_.exchange(false)) {
    Tasks tasks;
    std::vector<std::string> problems;
    {
      const std::lock_guard lock(telling_);
      std::swap(tasks, to_tell_);
      std::swap(problems, to_say_);
    }
    for (const std::string& each : problems) {
      const runtime::MustNotWait within;
      try {
        options_.problem(each);
      } catch (...) {  // There is nobody left to tell.
      }
    }
    for (auto& task : tasks) call_back(std::move(task));
  }
}

void Runtime::Engine::call_back(std::shared_ptr<Submitted> task) {
  std::string thrown;
  {
    const runtime::MustNotWait within;
    try {
      task->callback(TaskFuture(task), *task->ends);
    } catch (const std::exception& error) {
      thrown = error.what();
    } catch (...) {
      thrown = "an exception of an unknown type";
    }
    task->callback = nullptr;
  }
  if (!thrown.empty()) {
    const auto turn = turn_.take();
    add_problem("callback of " + task->workload->name + ": " + thrown);
  }
  told(std::move(task));
}

void Runtime::Engine::told(std::shared_ptr<Submitted> task) {
  task->told.set();
  task.reset();
  const std::size_t left = live_.fetch_sub(1) - 1;
  if ((left <= resume_at_ && waiting_for_room_ > 0) || (left == 0 && waiting_ > 0)) {
    const std::lock_guard lock(waiting_mutex_);
    fewer_.notify_all();
  }
}

void Runtime::Engine::wake_watcher() {
  const std::lock_guard lock(watch_mutex_);
  watch_now_ = true;
  watcher_rests_ = false;
  watch_sooner_.notify_one();
}

/// With nothing that runs and nothing to come it sleeps until somebody wakes it.
void Runtime::Engine::watch(const std::stop_token& stop) {
  name_thread("pirt-watch");
  static_cast<void>(take_priority(options_.priority));
  std::unique_lock lock(watch_mutex_);
  while (!stop.stop_requested()) {
    if (calls_run_ || watch_at_ != Nanos::max() || watch_now_) {
      const Nanos until = std::min(watch_at_, now() + kLook);
      const auto sooner = [&] { return watch_now_ || watch_at_ < until; };
      watch_sooner_.wait_until(lock, stop, std::chrono::steady_clock::time_point(began_ + until),
                               sooner);
    } else {
      watcher_rests_ = true;
      watch_sooner_.wait(lock, stop, [this] { return !watcher_rests_ || calls_run_; });
      watcher_rests_ = false;
      continue;
    }
    watch_at_ = Nanos::max();
    watch_now_ = false;
    lock.unlock();
    asked_ = true;
    work(Thread::kOurs);
    if (anything_left_) tell_left();
    lock.lock();
  }
}

}  // namespace pirt
