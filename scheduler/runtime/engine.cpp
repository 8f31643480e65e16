#include "scheduler/runtime/engine.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

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
  room_.wait_until_empty();
  // Calls that were cancelled as they ran still do, unless they are lost.
  room_.wait_until([this] { return !calls_run_; });
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
  auto task = std::make_shared<Submitted>();
  if (!room_.try_enter()) {
    if (!runtime::MustNotWait::here()) room_.wait_for_room();
    room_.enter();
  }
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

void Runtime::Engine::wait_all() {
  runtime::MustNotWait::check("waiting for tasks");
  room_.wait_until_empty();
}

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
                                .powered = each.powered,
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
  if (idle) room_.look_again();
  // It looks after calls that hang, and at what time brings.
  if (wake != Nanos::max() || ((!idle || out_of_reach_) && watcher_rests_)) {
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

}  // namespace pirt
