#include "scheduler/runtime/runtime.h"

#include <stdexcept>
#include <string>
#include <utility>

#include "scheduler/runtime/engine.h"
#include "workloads/base/error.h"
#include "workloads/model/slices.h"

namespace pirt {
namespace {

/// @throws Where that would be for ever.
void check_wait(const runtime::Submitted& task, const char* what) {
  if (task.told.is_set()) return;
  runtime::MustNotWait::check(what);
  runtime::check_process(task.forks);
}

}  // namespace

void runtime::TaskRef::hold(Submitted& task) { task.uses.fetch_add(1, std::memory_order_relaxed); }

void runtime::TaskRef::let_go(Submitted& task) {
  if (task.uses.fetch_sub(1, std::memory_order_acq_rel) > 1) return;
  task.forget_all();
  task.place.slab->give_back(task);
}

runtime::Submitted& TaskFuture::task() const {
  if (!task_) throw std::logic_error("a TaskFuture of no task was asked");
  return *task_;
}

std::optional<TaskEnd> TaskFuture::end() const {
  const int end = task().end.load(std::memory_order_acquire);
  return end == runtime::Submitted::kLive ? std::nullopt : std::optional(static_cast<TaskEnd>(end));
}

TaskEnd TaskFuture::wait() const {
  // Within its own callback it has ended.
  if (runtime::MustNotWait::here() && end()) return *end();
  check_wait(task(), "wait()");
  task_->told.wait();
  return *end();
}

std::optional<TaskEnd> TaskFuture::wait_for(Nanos most) const {
  if (runtime::MustNotWait::here() && end()) return end();
  check_wait(task(), "wait_for()");
  return task_->told.wait_for(most) ? end() : std::nullopt;
}

std::span<const Tensor> TaskFuture::get() const& {
  const TaskEnd end = wait();
  if (end != TaskEnd::kCompleted) {
    throw_environment(task_->name + " has no outputs, it was " + std::string(to_string(end)) +
                      (task_->problem.empty() ? "" : ": " + task_->problem));
  }
  const auto& outputs = task_->call.outputs;
  return outputs != nullptr ? std::span<const Tensor>(*outputs) : std::span<const Tensor>();
}

std::string TaskFuture::unit() const { return end() ? task_->unit_name : ""; }
Nanos TaskFuture::busy() const { return end() ? task_->busy : Nanos::zero(); }
Nanos TaskFuture::latency() const {
  return end() ? task_->ended_at - task_->submitted_at : Nanos::zero();
}
Nanos TaskFuture::waited() const {
  return end() && task_->started_at ? *task_->started_at - task_->submitted_at : Nanos::zero();
}
std::string TaskFuture::problem() const { return end() ? task_->problem : ""; }

std::stop_token stop_of_this_call() { return stop_of_call(); }

Runtime::Runtime(RuntimeOptions options) : engine_(std::make_unique<Engine>(std::move(options))) {}
Runtime::~Runtime() {
  // In a child that was forked nobody is there to end it.
  if (!engine_->is_here()) static_cast<void>(engine_.release());
}

TaskFuture Runtime::submit(WorkloadHandle workload, std::vector<TaskInput> inputs,
                           TaskOptions options, Callback callback) {
  return engine_->submit(workload, std::move(inputs), std::move(options), std::move(callback));
}
TaskFuture Runtime::submit(std::string_view workload, std::vector<TaskInput> inputs,
                           TaskOptions options, Callback callback) {
  return submit(this->workload(workload), std::move(inputs), std::move(options),
                std::move(callback));
}
WorkloadHandle Runtime::workload(std::string_view name) const { return engine_->find(name); }
void Runtime::cancel(const TaskFuture& task) { engine_->cancel(task); }
void Runtime::cancel_all() { engine_->cancel_all(); }
void Runtime::wait_all() { engine_->wait_all(); }
void Runtime::bring_back(std::string_view unit) { engine_->bring_back(unit); }
RuntimeStatistics Runtime::statistics() const { return engine_->statistics(); }
std::vector<Tensor> Runtime::state(std::string_view name) const { return engine_->state(name); }
void Runtime::write_trace() { engine_->write_trace(); }

}  // namespace pirt
