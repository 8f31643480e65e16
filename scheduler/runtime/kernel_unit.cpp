#include "scheduler/runtime/kernel_unit.h"

#include <algorithm>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/thread.h"

namespace pirt {

StateValue::StateValue(const Workload& workload)
    : sets_{workload.make_state(), make_tensors(workload.state->tensors)} {}

void StateValue::commit() {
  current_ = 1 - current_;
  ++version_;
}

KernelUnit::KernelUnit(UnitRequest request, const Backend& backend,
                       std::vector<Preparation> preparations, bool prepare_first,
                       std::function<void(Call&, CallEnd)> done)
    : request_(std::move(request)),
      backend_(backend),
      preparations_(std::move(preparations)),
      prepare_first_(prepare_first),
      done_(std::move(done)),
      thread_(start_thread([this] { serve(); })) {}

KernelUnit::~KernelUnit() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
}

void KernelUnit::wait_until_ready() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return ready_ || failure_ != nullptr; });
  if (failure_ != nullptr) std::rethrow_exception(failure_);
}

void KernelUnit::run(Call call) {
  {
    const std::lock_guard lock(mutex_);
    calls_.push_back(std::move(call));
  }
  changed_.notify_all();
}

void KernelUnit::serve() {
  try {
    set_up();
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
    changed_.notify_all();
    return;
  }
  std::unique_lock lock(mutex_);
  ready_ = true;
  changed_.notify_all();
  while (true) {
    changed_.wait(lock, [this] { return stopping_ || !calls_.empty(); });
    if (stopping_) break;
    Call call = std::move(calls_.front());
    calls_.pop_front();
    lock.unlock();
    CallEnd end = execute(call);
    done_(call, std::move(end));
    lock.lock();
  }
  lock.unlock();
  // Where they were made: a driver may want its own thread.
  kernels_.clear();
  device_.reset();
}

void KernelUnit::set_up() {
  device_ = backend_.open(request_);
  if (!prepare_first_) return;
  for (const Preparation& each : preparations_) prepare(each);
}

/// Ends with one completed run, since some compile at the first.
KernelUnit::Prepared& KernelUnit::prepare(const Preparation& preparation) {
  const Workload& workload = *preparation.workload;
  Prepared& made = kernels_[&workload];
  made.kernel = device_->prepare(workload, preparation.sample->parameters);
  std::optional<StateValue> state;
  if (workload.state) state.emplace(workload);
  Call first{.workload = &workload,
             .inputs = {},
             .outputs = std::make_shared<std::vector<Tensor>>(make_tensors(workload.outputs)),
             .state = state ? &*state : nullptr,
             .intended = Outcome::kFailed};
  for (const Tensor& input : preparation.sample->inputs) first.inputs.push_back(input.share());
  compute(made, first);
  made.resident = nullptr;
  return made;
}

KernelUnit::Prepared& KernelUnit::prepared(const Workload& workload) {
  const auto known = kernels_.find(&workload);
  if (known != kernels_.end()) return known->second;
  return prepare(*std::ranges::find(preparations_, &workload, &Preparation::workload));
}

CallEnd KernelUnit::execute(Call& call) {
  const Nanos start = clock_.now();
  CallEnd end;
  end.outcome = call.intended;
  const auto failed = [&](const std::string& why) {
    end.outcome = Outcome::kFailed;
    end.problem = call.workload->name + " on " + request_.unit + ": " + why;
  };
  try {
    compute(prepared(*call.workload), call);
  } catch (const std::exception& error) {
    failed(error.what());
  } catch (...) {
    failed("an exception of an unknown type");
  }
  end.busy = clock_.now() - start;
  return end;
}

void KernelUnit::compute(Prepared& prepared, Call& call) {
  Kernel& kernel = *prepared.kernel;
  kernel.bind(call.inputs, *call.outputs);
  if (call.state != nullptr) {
    kernel.bind_state(call.state->committed(), call.state->next());
    if (prepared.resident != call.state || prepared.version != call.state->version()) {
      prepared.resident = nullptr;  // Until it is there.
      kernel.upload_state();
      prepared.resident = call.state;
      prepared.version = call.state->version();
    }
  }
  kernel.upload();
  kernel.execute(1);
  kernel.download();
  if (call.state == nullptr || call.intended != Outcome::kCompleted) return;
  kernel.commit_state();
  call.state->commit();
  prepared.version = call.state->version();
}

}  // namespace pirt
