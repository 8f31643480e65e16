#include "scheduler/runtime/engine.h"

#include <algorithm>
#include <stdexcept>

#include "scheduler/runtime/time_limit.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr Nanos kLook = std::chrono::milliseconds(50);
constexpr std::size_t kMostProblems = 20;
constexpr int kMostReturns = 3;  ///< In a row, after which a unit is out of service.

}  // namespace

thread_local bool runtime::MustNotWait::here_ = false;

void runtime::MustNotWait::check(const char* what) {
  if (!here_) return;
  throw std::logic_error(std::string(what) +
                         " in a callback or a kernel would wait for itself; submit what comes "
                         "next with `after` instead");
}

Runtime::Engine::~Engine() {
  {
    const std::lock_guard lock(asking_);
    cancels_all_ = true;
  }
  asked_ = true;
  work();
  wait_until(0);
  // Calls that were cancelled as they ran still do, unless they are lost.
  {
    std::unique_lock lock(waiting_mutex_);
    ++waiting_;
    fewer_.wait(lock, [this] { return !calls_run_; });
    --waiting_;
  }
  watcher_ = {};
  for (Unit& unit : units_) {
    if (unit.runner && unit.runner->abandoned()) KernelUnit::leave(std::move(unit.runner));
  }
  for (Unit& unit : units_) unit.runner.reset();
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
      const auto& outputs = output.task->workload->outputs;
      if (output.task->engine != this || output.index >= outputs.size()) {
        throw_bad_input(workload.name + ": input " + workload.inputs[i].name +
                        " is of a task of another runtime, or an output that is not there");
      }
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
  const UnitMask eligible = known.runs_on & units_named(options.eligible);
  if (eligible == 0) {
    throw_bad_input(known.workload->name + ": none of the units " + join(options.eligible, ", ") +
                    " can run it; leave `eligible` out, or name one of " +
                    unit_list(options_.platform, known.runs_on));
  }
  if (live_.fetch_add(1) >= options_.most_tasks && !runtime::MustNotWait::here()) {
    live_.fetch_sub(1);
    wait_until(resume_at_);
    live_.fetch_add(1);
  }
  auto task = std::make_shared<Submitted>();
  task->engine = this;
  task->workload = known.workload;
  task->workload_index = index;
  task->eligible = eligible;
  task->inputs = std::move(inputs);
  task->options = std::move(options);
  task->callback = std::move(callback);
  task->submitted_at = now();
  task->self = task;
  post(*task, Submitted::Event::kSubmit);
  work();
  return TaskFuture(std::move(task));
}

void Runtime::Engine::cancel(const TaskFuture& task) {
  if (!task.valid() || task.task_->engine != this) {
    throw_bad_input("cancel: the task is none of this runtime");
  }
  {
    const std::lock_guard lock(asking_);
    cancels_.push_back(task.task_);
  }
  asked_ = true;
  work();
}

/// Until at most so many tasks have not ended.
void Runtime::Engine::wait_until(std::size_t most) {
  runtime::MustNotWait::check("waiting for tasks");
  std::unique_lock lock(waiting_mutex_);
  ++waiting_;
  fewer_.wait(lock, [&] { return live_ <= most; });
  --waiting_;
}

void Runtime::Engine::wait_all() { wait_until(0); }

RuntimeStatistics Runtime::Engine::statistics() {
  while (turn_.exchange(true)) std::this_thread::yield();
  RuntimeStatistics statistics = counts_;
  statistics.returned = dispatcher_->counts().returned;
  statistics.set_up = set_up_;
  statistics.live = statistics.submitted - statistics.completed - statistics.failed -
                    statistics.dropped - statistics.expired - statistics.cancelled;
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    const Unit& each = units_[unit];
    if (each.runner == nullptr) continue;
    statistics.units.push_back({.name = options_.platform.units[unit].name,
                                .in_service = each.in_service,
                                .completed = each.completed,
                                .busy = each.busy,
                                .latency = each.latency});
  }
  turn_ = false;
  work();  // What was left to who had the turn.
  return statistics;
}

std::vector<Tensor> Runtime::Engine::state(std::string_view name) {
  const auto known = state_names_.find(name);
  if (known == state_names_.end()) {
    throw_bad_input("no workload of this runtime has a state '" + std::string(name) + "'");
  }
  while (turn_.exchange(true)) std::this_thread::yield();
  auto copy = copy_tensors(states_[known->second]->committed());
  turn_ = false;
  work();
  return copy;
}

void Runtime::Engine::write_trace() {
  if (trace_ == nullptr) throw_bad_input("write_trace: the runtime's options name no trace");
  wait_all();
  while (turn_.exchange(true)) std::this_thread::yield();
  const auto trace = std::move(trace_);
  dispatcher_->observe(nullptr);
  turn_ = false;
  work();
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

void Runtime::Engine::work() {
  while (posted_.load() != nullptr || asked_) {
    // Who has it looks again after it has given it back.
    if (turn_.exchange(true)) return;
    take_turn();
    end_turn();
  }
}

void Runtime::Engine::end_turn() {
  std::vector<std::shared_ptr<Submitted>> ended;
  std::swap(ended, ended_);
  const Nanos wake = dispatcher_->next_wake();
  const bool idle = running_ == 0;
  calls_run_ = !idle;
  turn_ = false;
  if (idle && waiting_ > 0) {
    const std::lock_guard lock(waiting_mutex_);
    fewer_.notify_all();
  }
  if (wake != Nanos::max()) {
    const std::lock_guard lock(watch_mutex_);
    if (wake < watch_at_) {
      watch_at_ = wake;
      watch_sooner_.notify_one();
    }
  }
  tell(ended);
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
    if (task.event == Submitted::Event::kSubmit) {
      take_in(task, now);
    } else {
      take_end(task, now);
    }
    apply(now);
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
  after_.clear();
  bool doomed = false;
  const auto follow = [&](const Submitted* before) {
    if (before == nullptr || before->ends == TaskEnd::kCompleted) return;
    doomed = doomed || before->ends.has_value();
    after_.push_back(before->id);
  };
  for (const TaskInput& input : task.inputs) follow(input.output_.task.get());
  for (const TaskFuture& before : task.options.after) follow(before.task_.get());
  if (doomed) return finish(task, TaskEnd::kDropped, now);
  Task submitted;
  submitted.id = task.id;
  submitted.kind = setup_->scenario.classes[task.workload_index][0];
  submitted.kind.eligible = task.eligible;
  submitted.kind.real_time = task.options.real_time;
  if (task.options.deadline) submitted.deadline = task.submitted_at + *task.options.deadline;
  if (task.options.expires) submitted.expires_at = task.submitted_at + *task.options.expires;
  submitted.after = after_;
  submitted.state = workloads_[task.workload_index].state;
  task.known = true;
  if (trace_) trace_->submitting(task.id, task.workload_index, 0, number_);
  if (!dispatcher_->submit(task.id, std::span(&submitted, 1), now, starts_)) {
    throw std::logic_error("the dispatcher refused a task of the runtime");
  }
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
  if (end.outcome == Outcome::kReturned) {
    if (++unit.returns >= kMostReturns && unit.in_service) {
      out_of_service(task.unit,
                     "it gave back " + std::to_string(unit.returns) + " calls one after the other",
                     now);
    }
    if (task.ends) forget(task, now);
    return;
  }
  unit.returns = 0;
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

/// What time has brought: tasks that were to start by now, and calls that do not end.
void Runtime::Engine::look(Nanos now) {
  dispatcher_->wake(now, starts_);
  apply(now);
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    if (units_[unit].runner == nullptr || units_[unit].runner->abandoned()) continue;
    const auto call = units_[unit].runner->running();
    if (!call) continue;
    const std::size_t index = task_of(*call).workload_index;
    const Known& known = workloads_[index];
    const bool expected =
        options_.profile || (known.own != nullptr && !known.own->expected.empty());
    if (!expected && !options_.time_limit) continue;
    const Service* service = setup_->scenario.services.find(static_cast<WorkloadId>(index), unit);
    const Nanos limit = options_.time_limit
                            ? *options_.time_limit
                            : time_limit(*service, units_[unit].runner->has_own_clock());
    if (now - (call->since - began_) > limit) lose(unit, *call, now);
  }
}

/// The call never comes back to anybody.
void Runtime::Engine::lose(UnitId unit, const KernelUnit::Running& call, Nanos now) {
  const auto behind = units_[unit].runner->abandon(call.token);
  if (!behind) return;
  Submitted& task = task_of(call);
  lost_.push_back(tasks_[static_cast<std::uint32_t>(task.id)]);
  if (const auto& id = workloads_[task.workload_index].state) {
    states_[*id] = std::make_shared<StateValue>(*states_[*id]);
  }
  out_of_service(
      unit,
      overdue(task.workload->name, options_.platform.units[unit].name, now - (call.since - began_)),
      now);
  const auto ended = [&](std::uint64_t token, Outcome outcome) {
    Submitted& each = task_at(token);
    each.call_end = {.outcome = outcome, .problem = counts_.problems.back()};
    each.event = Submitted::Event::kEnd;
    take_end(each, now);
    apply(now);
  };
  ended(call.token, Outcome::kFailed);
  for (const std::uint64_t token : *behind) ended(token, Outcome::kReturned);
}

void Runtime::Engine::out_of_service(UnitId unit, const std::string& why, Nanos now) {
  units_[unit].in_service = false;
  add_problem("unit " + options_.platform.units[unit].name + " is out of service: " + why);
  dispatcher_->set_unit(unit, UnitState::kDown, now, starts_);
}

void Runtime::Engine::cancel_asked(Nanos now) {
  std::vector<std::shared_ptr<Submitted>> cancels;
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
    const auto& task = tasks_[static_cast<std::uint32_t>(each.task)];
    if (task == nullptr || task->id != each.task || task->ends) continue;
    switch (each.how) {
      case Ending::kExpired:
        finish(*task, TaskEnd::kExpired, now);
        break;
      case Ending::kFailed:
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
  task.unit_name = options_.platform.units[start.unit].name;
  task.running = true;
  ++running_;
  task.outputs = task.workload->outputs.empty() ? nothing_ : pool_.take(*task.workload);
  if (trace_) {
    trace_->arrived(start.unit, static_cast<std::uint32_t>(start.task),
                    options_.platform.units[start.unit].active_w);
  }
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
  units_[start.unit].runner->run(std::move(call));
}

void Runtime::Engine::finish(Submitted& task, TaskEnd end, Nanos now) {
  task.ends = end;
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
  if (counts_.problems.size() < kMostProblems) counts_.problems.push_back(std::move(problem));
}

/// Without the turn: callbacks may submit.
void Runtime::Engine::tell(std::vector<std::shared_ptr<Submitted>>& ended) {
  for (auto& task : ended) {
    task->end.store(static_cast<int>(*task->ends), std::memory_order_release);
    if (task->callback) {
      const runtime::MustNotWait within;
      try {
        task->callback(TaskFuture(task), *task->ends);
      } catch (const std::exception& error) {
        while (turn_.exchange(true)) std::this_thread::yield();
        add_problem("callback of " + task->workload->name + ": " + error.what());
        turn_ = false;
      }
      task->callback = nullptr;
    }
    task->told.store(true, std::memory_order_release);
    task->told.notify_all();
    task.reset();
    const std::size_t left = live_.fetch_sub(1) - 1;
    if ((left == resume_at_ || left == 0) && waiting_ > 0) {
      const std::lock_guard lock(waiting_mutex_);
      fewer_.notify_all();
    }
  }
}

void Runtime::Engine::watch(const std::stop_token& stop) {
  std::unique_lock lock(watch_mutex_);
  while (!stop.stop_requested()) {
    const Nanos until = std::min(watch_at_, now() + kLook);
    const auto sooner = [&] { return watch_at_ < until; };
    watch_sooner_.wait_until(lock, stop, std::chrono::steady_clock::time_point(began_ + until),
                             sooner);
    watch_at_ = Nanos::max();
    lock.unlock();
    asked_ = true;
    work();
    lock.lock();
  }
}

}  // namespace pirt
