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

runtime::Atomic<int>& runtime::forks() {
  static constinit Atomic<int> count = 0;
  return count;
}

void runtime::check_process(int before) {
  if (forks().load(std::memory_order_relaxed) == before) return;
  throw_environment("this process was forked after the runtime was made; make it afterwards");
}

thread_local bool runtime::MustNotWait::here_ = false;

void runtime::MustNotWait::check(const char* what) {
  if (!here_) return;
  throw std::logic_error(std::string(what) +
                         " in a callback or a kernel would wait for itself; submit what comes "
                         "next with `after` instead");
}

void runtime::Submitted::begin() {
  uses.store(2, std::memory_order_relaxed);  // The engine and who submits.
  taken_in = known = running = suspended = false;
  unit_name.clear();
  name.clear();
  problem.clear();
  busy = Nanos::zero();
  started_at.reset();
  end.store(kLive, std::memory_order_relaxed);
  told.reset();
}

void runtime::Submitted::forget_all() {
  inputs.clear();
  options.after.clear();
  callback = nullptr;
  call.let_go();
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
  watcher_.request_stop();
  wake_watcher();
  watcher_ = {};
  // Who is about to look once more finds it taken.
  turn_.take().keep_for_good();
  live_units_.close();
}

WorkloadHandle Runtime::Engine::find(std::string_view workload) const {
  WorkloadHandle handle;
  handle.engine_ = number_of_engine_;
  if (const auto known = names_.find(workload); known != names_.end()) {
    handle.index_ = known->second;
    return handle;
  }
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
    if (output.task) {
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

/// Units that the task may be given to.
UnitMask Runtime::Engine::units_for(const Known& known, const TaskOptions& options) const {
  UnitMask named = options.eligible.empty() ? known.runs_on : 0;
  for (const std::string& name : options.eligible) {
    const UnitModel& unit = options_.platform.unit(name);
    named |= known.runs_on & unit_bit(static_cast<UnitId>(&unit - options_.platform.units.data()));
  }
  if (named == 0) {
    throw_bad_input(known.workload->name + ": none of the units " + join(options.eligible, ", ") +
                    " can run it; leave `eligible` out, or name one of " +
                    unit_list(options_.platform, known.runs_on));
  }
  const UnitMask taken = named & (options.real_time ? known.real_time_takers : known.takers);
  if (taken != 0) return taken;
  throw_bad_input(known.workload->name + ": mode " + options_.mode +
                  " would never place this task" +
                  (options.real_time ? ", which is real-time" : "") + ": only " +
                  unit_list(options_.platform, named) +
                  " may serve it, which the mode does not use for that; take another mode" +
                  (options.eligible.empty() ? "" : ", or leave `eligible` out"));
}

TaskFuture Runtime::Engine::submit(WorkloadHandle workload, std::vector<TaskInput> inputs,
                                   TaskOptions options, Callback callback) {
  if (workload.engine_ != number_of_engine_) {
    throw_bad_input("submit: the workload's handle is none of this runtime's");
  }
  runtime::check_process(forks_);
  const Known& known = workloads_[workload.index_];
  check_inputs(*known.workload, inputs);
  for (const TaskFuture& before : options.after) {
    if (before.valid() && before.task_->engine == number_of_engine_) continue;
    throw_bad_input(known.workload->name + ": one of `after` is no task of this runtime");
  }
  const UnitMask eligible = units_for(known, options);
  if (closing_) {
    throw_environment(known.workload->name + ": the runtime is ending and takes nothing new");
  }
  // Who waits for room has no record: there are no more than tasks that have not ended, or that
  // somebody still holds.
  room_.enter(!runtime::MustNotWait::here());
  Submitted* record = nullptr;
  try {
    record = &records_->take();
  } catch (...) {  // No memory.
    room_.leave();
    throw;
  }
  Submitted& task = *record;
  task.begin();
  task.engine = number_of_engine_;
  task.forks = forks_;
  task.workload = known.workload;
  task.workload_index = workload.index_;
  task.eligible = eligible;
  task.inputs = std::move(inputs);
  task.options = std::move(options);
  task.callback = std::move(callback);
  task.submitted_at = now();
  TaskFuture future{TaskRef(task)};
  const std::uint64_t turns = turns_.load();
  const Prospect now = prospect(task);
  post(submitted_, task, Submitted::Event::kSubmit);
  if (!may_wait(now, turns)) work(Thread::kTheirs);
  return future;
}

Runtime::Engine::Prospect Runtime::Engine::prospect(const Submitted& task) {
  if (task.options.expires) return Prospect::kUrgent;
  Prospect so_far = Prospect::kReady;
  visit_before(task, [&](const Submitted& before) {
    if (so_far == Prospect::kUrgent) return;
    const int end = before.end.load(std::memory_order_acquire);
    if (end == Submitted::kLive) {
      so_far = Prospect::kWaits;
    } else if (end != static_cast<int>(TaskEnd::kCompleted)) {
      so_far = Prospect::kUrgent;
    }
  });
  return so_far;
}

/// Whether what was posted may wait for the turn that the end of some call will bring: nothing
/// could start now. Either who has the turn finds the task, or this finds how the turn ended
/// (turns_).
/// @param turns  As it was before @p prospect was.
bool Runtime::Engine::may_wait(Prospect prospect, std::uint64_t turns) {
  const std::uint64_t now = turns_.load();
  if (prospect == Prospect::kReady) return (now & 1U) == 0;
  // What it waits for was undecided, and is yet if no turn has ended: its own is to come.
  if (prospect == Prospect::kWaits && now / 2 == turns / 2) return true;
  asked_.fetch_or(kTakeIn);
  return false;
}

void Runtime::Engine::cancel(const TaskFuture& task) {
  runtime::check_process(forks_);
  if (!task.valid() || task.task_->engine != number_of_engine_) {
    throw_bad_input("cancel: the task is none of this runtime");
  }
  {
    const std::lock_guard lock(asking_);
    cancels_.push_back(task.task_);
  }
  asked_.fetch_or(kLook);
  work(Thread::kTheirs);
}

void Runtime::Engine::cancel_all() {
  runtime::check_process(forks_);
  {
    const std::lock_guard lock(asking_);
    cancels_all_ = true;
  }
  asked_.fetch_or(kLook);
  work(Thread::kTheirs);
}

void Runtime::Engine::wait_all() {
  runtime::check_process(forks_);
  runtime::MustNotWait::check("waiting for tasks");
  room_.wait_until_empty();
}

RuntimeStatistics Runtime::Engine::statistics() {
  runtime::check_process(forks_);
  TaskChain ended;
  auto turn = turn_.take();
  take_turn();  // What is submitted is counted.
  RuntimeStatistics statistics = counts_;
  statistics.problems = problems_.first();
  statistics.returned = dispatcher_->counts().returned;
  statistics.left = dispatcher_->counts().suspended;
  statistics.set_up = set_up_;
  statistics.live = statistics.submitted - statistics.completed - statistics.failed -
                    statistics.dropped - statistics.expired - statistics.cancelled;
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    if (live_units_.has(unit)) statistics.units.push_back(units_[unit]);
  }
  end_turn(turn, ended);
  tell(ended, Thread::kTheirs);
  work(Thread::kTheirs);  // What was posted for who had the turn.
  return statistics;
}

std::vector<Tensor> Runtime::Engine::state(std::string_view name) {
  const auto known = state_names_.find(name);
  if (known == state_names_.end()) {
    throw_bad_input("no workload of this runtime has a state '" + std::string(name) + "'");
  }
  runtime::check_process(forks_);
  std::vector<Tensor> copy;
  in_turn([&] { copy = copy_tensors(live_units_.state(known->second).committed()); });
  return copy;
}

void Runtime::Engine::write_trace() {
  if (trace_ == nullptr) throw_bad_input("write_trace: the runtime's options name no trace");
  wait_all();
  std::unique_ptr<TraceThread> trace;
  in_turn([&] {
    trace = std::move(trace_);
    dispatcher_->observe(nullptr);
  });
  Tally tally;
  tally.end = now();
  trace->finish();
  writer_->finish(tally);
}

void Runtime::Engine::post(runtime::Atomic<Submitted*>& list, Submitted& task,
                           Submitted::Event event) {
  task.event = event;
  task.next = list.load(std::memory_order_relaxed);
  while (!list.compare_exchange_weak(task.next, &task)) continue;
}

void Runtime::Engine::work(Thread thread) {
  TaskChain ended;
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

void Runtime::Engine::end_turn(runtime::Turn::Held& turn, TaskChain& ended) {
  const runtime::MustNotWait within;
  const std::vector<Tensor> freed = std::exchange(freed_, {});  // Until the turn is over.
  ended.append(ended_);
  const bool idle = running_ == 0;
  Nanos due = dispatcher_->next_wake();
  // Also at calls that hang.
  if (!idle || live_units_.any_out_of_reach()) due = std::min(due, look_at_);
  if (calls_run_.load(std::memory_order_relaxed) == idle) calls_run_ = !idle;
  const bool not_to_wait = with_room_ != 0 || std::exchange(some_did_not_complete_, false);
  turns_.store(((turns_.load(std::memory_order_relaxed) | 1U) + 1U) | (not_to_wait ? 1U : 0U));
  turn.give_back();
  if (idle && closing_) room_.look_again();
  watch_by(due);
}

void Runtime::Engine::take_turn() {
  // First: who asks has posted before.
  const unsigned asked = asked_.load() != 0 ? asked_.exchange(0) : 0;
  take_all(submitted_);
  take_all(ended_calls_);
  if ((asked & kLook) != 0) {
    now_ = std::max(now_, now());
    cancel_asked();
    look();
    apply();
  }
  if (!trace_) return;
  dispatcher_->list_waiting(queued_);
  trace_->settled(now_, queued_);
}

/// In the order in which they were posted.
void Runtime::Engine::take_all(runtime::Atomic<Submitted*>& list) {
  if (list.load(std::memory_order_relaxed) == nullptr) return;
  Submitted* oldest = nullptr;
  for (Submitted* newest = list.exchange(nullptr); newest != nullptr;) {
    Submitted* const before = std::exchange(newest->next, oldest);
    oldest = std::exchange(newest, before);
  }
  while (oldest != nullptr) take_event(*std::exchange(oldest, oldest->next));
}

}  // namespace pirt
