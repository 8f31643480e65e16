#include "scheduler/runtime/kernel_unit.h"

#include <pthread.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"

namespace pirt {

Nanos CallTimes::of(Phase phase) const {
  switch (phase) {
    case Phase::kUpload:
      return upload;
    case Phase::kLaunch:
      return launch.value_or(Nanos::zero());
    case Phase::kExecute:
      return execute;
    case Phase::kDownload:
      return download;
    default:
      return upload + launch.value_or(Nanos::zero()) + execute + download;
  }
}

StateValue::StateValue(const Workload& workload)
    : initial_(std::make_shared<const std::vector<Tensor>>(workload.make_state())),
      sets_{copy_tensors(*initial_), make_tensors(workload.state->tensors)} {}

StateValue::StateValue(const StateValue& other)
    : initial_(other.initial_),
      sets_{copy_tensors(other.committed()), copy_tensors(other.committed())} {}

void StateValue::commit(std::uint64_t version) {
  current_ = 1 - current_;
  version_ = version;
}

void StateValue::restart() {
  for (std::size_t i = 0; i < initial_->size(); ++i) copy_tensor((*initial_)[i], next()[i]);
  commit(0);
}

namespace {

/// Of the lane whose thread this is, and the unit that it is of.
thread_local const std::stop_source* stop_here = nullptr;
thread_local const void* lane_here = nullptr;

/// Whose inputs and outputs are gone, or others', before the kernel's next call.
struct Unbinding {
  Kernel& kernel;
  ~Unbinding() {
    try {
      kernel.unbind();
    } catch (...) {  // The device is lost: the call has failed, or the next one will.
    }
  }
};

/// Turns to wait awake before sleeping: short kernels follow each other, and waking up takes longer
/// than they do. Each gives its core to whoever else wants it.
constexpr int kTurnsAwake = 100;

}  // namespace

std::string take_priority(int priority) {
  if (priority <= 0) return "";
  sched_param parameters{};
  parameters.sched_priority = priority;
  const int error = ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters);
  if (error == 0) return "";
  return "no real-time priority " + std::to_string(priority) + ": " + std::strerror(error) +
         "; it needs CAP_SYS_NICE or a limit (ulimit -r)";
}

KernelUnit::KernelUnit(UnitSetup setup, std::function<void(Call&, CallEnd)> done)
    : setup_(std::move(setup)),
      done_(std::move(done)),
      lanes_(static_cast<std::size_t>(setup_.lanes)),
      thread_(start_thread([this] { serve(); })) {}

KernelUnit::~KernelUnit() { stop(); }

void KernelUnit::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    for (Lane& lane : lanes_) {
      if (remote_ != nullptr && lane.running) lane.stop.request_stop();
    }
  }
  changed_.notify_all();
}

void KernelUnit::leave(std::unique_ptr<KernelUnit> unit) {
  unit->thread_.detach();
  static_cast<void>(unit.release());
}

bool KernelUnit::is_over_start(Nanos most) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, most, [this] { return ready_ || failure_ != nullptr; });
}

bool KernelUnit::wait_until_ready(Nanos most) {
  const bool over = is_over_start(most);
  if (over && failure_ != nullptr) std::rethrow_exception(failure_);
  return over;
}

void KernelUnit::run(Call call) {
  for (Lane& lane : lanes_) {
    if (lane_here != &lane) continue;
    // What is given to a unit elsewhere can be withdrawn before it begins.
    if (!lane.telling || lane.next || waiting_ != 0 || remote_ != nullptr) break;
    lane.next = std::move(call);
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    calls_.push_back(std::move(call));
    waiting_ = calls_.size();
  }
  changed_.notify_one();
}

std::vector<KernelUnit::Running> KernelUnit::running() const {
  const std::lock_guard lock(mutex_);
  std::vector<Running> running;
  for (const Lane& lane : lanes_) {
    if (lane.running && !abandoned_) running.push_back(*lane.running);
  }
  return running;
}

std::optional<std::vector<std::uint64_t>> KernelUnit::abandon(std::uint64_t token) {
  const std::lock_guard lock(mutex_);
  Lane& lane = lanes_.front();
  if (abandoned_ || !lane.running || lane.running->token != token) return std::nullopt;
  abandoned_ = true;
  lane.stop.request_stop();
  std::vector<std::uint64_t> behind;
  for (const Call& call : calls_) behind.push_back(call.token);
  calls_.clear();
  return behind;
}

bool KernelUnit::request_stop(std::uint64_t token) {
  const std::lock_guard lock(mutex_);
  for (Lane& lane : lanes_) {
    if (lane.running && lane.running->token == token) return lane.stop.request_stop();
  }
  const auto waits = std::ranges::find(calls_, token, &Call::token);
  return remote_ != nullptr && waits != calls_.end() && !std::exchange(waits->unwanted, true);
}

std::stop_token KernelUnit::stop_of_this_call() {
  return stop_here != nullptr ? stop_here->get_token() : std::stop_token();
}

void KernelUnit::wait_for_call(Lane& lane, std::unique_lock<std::mutex>& lock) {
  if (calls_.empty() && !stopping_ && !lane.next) {
    lock.unlock();
    for (int turn = 0; turn < kTurnsAwake && waiting_ == 0 && !stopping_; ++turn) {
      std::this_thread::yield();
    }
    lock.lock();
  }
  changed_.wait(lock, [&] { return stopping_ || lane.next || !calls_.empty(); });
}

Call KernelUnit::take_call(Lane& lane) {
  if (lane.next) {
    Call call = *std::move(lane.next);
    lane.next.reset();
    return call;
  }
  Call call = std::move(calls_.front());
  calls_.pop_front();
  waiting_ = calls_.size();
  return call;
}

void KernelUnit::serve() {
  name_thread(name());
  stop_here = &lanes_.front().stop;
  std::vector<std::jthread> others;
  try {
    set_up();
    for (std::size_t i = 1; i < lanes_.size(); ++i) {
      others.push_back(start_thread([this, &lane = lanes_[i]] {
        name_thread(name());
        static_cast<void>(take_priority(setup_.priority));
        serve_calls(lane);
        lane.kernels.clear();
      }));
    }
  } catch (...) {
    stop();  // Those that have begun.
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
    changed_.notify_all();
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    ready_ = true;
  }
  changed_.notify_all();
  serve_calls(lanes_.front());
  others.clear();
  if (abandoned_) return;
  // Where they were made: a driver may want its own thread.
  lanes_.front().kernels.clear();
  device_.reset();
}

void KernelUnit::serve_calls(Lane& lane) {
  stop_here = &lane.stop;
  lane_here = &lane;
  std::unique_lock lock(mutex_);
  while (true) {
    wait_for_call(lane, lock);
    if (stopping_) return;
    Call call = take_call(lane);
    lane.running = {.token = call.token, .since = clock_.now()};
    lock.unlock();
    CallEnd end = execute(lane, call);
    lock.lock();
    end.busy = clock_.now() - lane.running->since;
    lane.running.reset();
    const bool unwanted = call.unwanted || lane.stop.stop_requested();
    if (unwanted) lane.stop = std::stop_source();
    if (abandoned_) return;  // Nobody knows of the call any more; what it holds goes with it.
    lock.unlock();
    if (remote_ != nullptr) {
      end.excused = unwanted || !remote_->is_reachable();
      const bool withdrawn = unwanted && end.outcome == Outcome::kReturned;
      if (withdrawn) end.problem.clear();  // It is what was asked for.
    }
    lane.telling = true;
    done_(call, std::move(end));
    lane.telling = false;
    lock.lock();
  }
}

void KernelUnit::set_up() {
  remark_ = take_priority(setup_.priority);
  if (setup_.backend != nullptr) {
    device_ = setup_.backend->open(setup_.request);
    device_info_ = device_->info();
    const std::string& remark = device_info_->remark;
    if (!remark.empty()) remark_ += (remark_.empty() ? "" : "; ") + remark;
    has_own_clock_ = device_->own_clock() != nullptr;
    auto* const remote = dynamic_cast<Remote*>(device_.get());
    const std::lock_guard lock(mutex_);
    remote_ = remote;
  }
  if (setup_.lanes > 1 && remote_ == nullptr) {
    throw_bad_input(std::to_string(setup_.lanes) +
                    " servers, and a unit that computes here serves one call after the other; take "
                    "`servers` out, or give each its cores as a unit of its own");
  }
  // What is out of reach is prepared once it is not, at the first call.
  if (!setup_.prepare_first || !is_reachable()) return;
  // The first one last, where one program at a time is held.
  for (auto each = setup_.preparations.rbegin(); each != setup_.preparations.rend(); ++each) {
    if (stopping_) return;
    Lane& lane = lanes_.front();
    Prepared& made = prepare(lane, *each);
    if (!each->function) run_once(lane, *each, made);
  }
}

/// Whether the unit holds both at once.
bool KernelUnit::go_together(const Workload& one, const Workload& other) const {
  if (!setup_.contexts || &one == &other) return true;
  const auto program = setup_.contexts->program_of(one.name);
  return program && program == setup_.contexts->program_of(other.name);
}

KernelUnit::Prepared& KernelUnit::prepare(Lane& lane, const Preparation& preparation) {
  const Workload& workload = *preparation.workload;
  std::erase_if(lane.kernels,
                [&](const auto& held) { return !go_together(*held.first, workload); });
  auto kernel = preparation.function ? std::make_unique<FunctionKernel>(preparation.function)
                                     : device_->prepare(workload, preparation.sample->parameters);
  return lane.kernels[&workload] = {.kernel = std::move(kernel)};
}

/// Some compile at the first run.
void KernelUnit::run_once(Lane& lane, const Preparation& preparation, Prepared& prepared) {
  const Workload& workload = *preparation.workload;
  Call first{.workload = &workload,
             .inputs = {},
             .outputs = std::make_shared<std::vector<Tensor>>(make_tensors(workload.outputs)),
             .state = workload.state ? std::make_shared<StateValue>(workload) : nullptr,
             .intended = Outcome::kFailed};
  for (const Tensor& input : preparation.sample->inputs) first.inputs.push_back(input.share());
  CallTimes unused;
  compute(lane, prepared, first, unused);
  prepared.resident = nullptr;
}

/// @param end  Is told what preparing took, if it was not there.
KernelUnit::Prepared& KernelUnit::prepared(Lane& lane, const Workload& workload, CallEnd& end) {
  const auto known = lane.kernels.find(&workload);
  if (known != lane.kernels.end()) return known->second;
  const Nanos begin = clock_.now();
  Prepared& made =
      prepare(lane, *std::ranges::find(setup_.preparations, &workload, &Preparation::workload));
  if (setup_.contexts) {
    for (const Preparation& each : setup_.preparations) {
      const bool is_held = lane.kernels.contains(each.workload);
      if (!is_held && go_together(*each.workload, workload)) prepare(lane, each);
    }
  }
  end.preparing = clock_.now() - begin;
  return made;
}

CallEnd KernelUnit::execute(Lane& lane, Call& call) {
  CallEnd end;
  if (call.unwanted) {
    end.outcome = Outcome::kReturned;
    return end;
  }
  end.outcome = call.intended;
  const auto ended = [&](Outcome outcome, const std::string& why) {
    end.outcome = outcome;
    end.problem = call.workload->name + " on " + name() + ": " + why;
  };
  try {
    end.version = compute(lane, prepared(lane, *call.workload, end), call, end.times);
  } catch (const Error& error) {
    // The device could not; another may.
    const bool environment = error.code() == ErrorCode::kEnvironment;
    ended(environment ? Outcome::kReturned : Outcome::kFailed, error.what());
  } catch (const std::exception& error) {
    ended(Outcome::kFailed, error.what());
  } catch (...) {
    ended(Outcome::kFailed, "an exception of an unknown type");
  }
  return end;
}

/// @return  The version of the state that it wrote; 0 if it has none, or is not to count.
std::uint64_t KernelUnit::compute(Lane& lane, Prepared& prepared, Call& call, CallTimes& times) {
  Kernel& kernel = *prepared.kernel;
  kernel.bind(call.inputs, *call.outputs);
  const Unbinding unbinding{kernel};
  // What is under way elsewhere can be taken back.
  const std::stop_callback withdrawn(lane.stop.get_token(), [&] {
    if (remote_ != nullptr) remote_->withdraw(kernel);
  });
  if (call.state != nullptr) {
    kernel.bind_state(call.state->committed(), call.state->next());
    if (prepared.resident != call.state.get() || prepared.version != call.state->version()) {
      prepared.resident = nullptr;  // Until it is there.
      kernel.upload_state();
      prepared.resident = call.state.get();
      prepared.version = call.state->version();
    }
  }
  const Nanos begin = clock_.now();
  kernel.upload();
  const Nanos uploaded = clock_.now();
  times.launch = kernel.execute(1);
  const Nanos executed = clock_.now();
  kernel.download();
  times.upload = uploaded - begin;
  times.execute = executed - uploaded - times.launch.value_or(Nanos::zero());
  times.download = clock_.now() - executed;
  if (call.state == nullptr || call.intended != Outcome::kCompleted) return 0;
  static std::atomic<std::uint64_t> versions = 0;
  kernel.commit_state();
  return prepared.version = ++versions;
}

}  // namespace pirt
