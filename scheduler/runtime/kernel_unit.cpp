#include "scheduler/runtime/kernel_unit.h"

#include <pthread.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "scheduler/runtime/begin_thread.h"
#include "workloads/base/error.h"
#include "workloads/base/system/pause.h"
#include "workloads/base/system/thread.h"
#include "workloads/model/device_choice.h"
#include "workloads/model/own_operation.h"
#include "workloads/model/ranges.h"
#include "workloads/model/slices.h"

namespace pirt {
namespace {

/// Of the lane whose thread this is.
thread_local void* lane_here = nullptr;

std::span<Tensor> outputs_of(const Call& call) {
  return call.outputs != nullptr ? std::span(*call.outputs) : std::span<Tensor>();
}

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

/// A value that is out of its range might be an endless loop, or a state that is no state any more.
/// @param own  What is not pirt's takes what it likes where it says nothing of it.
/// @throws Error{kBadInput}
void check_values(const Call& call, bool own) {
  for (std::size_t i = 0; i < call.inputs.size(); ++i) {
    const TensorSpec& spec = call.workload->inputs[i];
    if (own && spec.ranges.empty()) continue;
    if (std::string why = out_of_range(call.inputs[i], spec); !why.empty()) throw_bad_input(why);
  }
}

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

std::string not_asked_for(const Workload& workload, const Support& served) {
  return workload.name + " is not asked for there: " + served.reason;
}

KernelUnit::KernelUnit(UnitSetup setup, Done done)
    : setup_(std::move(setup)),
      done_(std::move(done)),
      lanes_(static_cast<std::size_t>(setup_.lanes)),
      thread_(runtime::start_thread([this] { serve(); })) {}

KernelUnit::~KernelUnit() { stop(); }

void KernelUnit::stop() {
  stopping_ = true;
  if (is_remote()) {
    for (Lane& lane : lanes_) {
      if (const auto call = lane.running.seen()) lane.running.request_stop(call->number);
    }
  }
  bell_.ring(setup_.lanes);
}

void KernelUnit::Close::operator()(KernelUnit* unit) const {
  // What it gets for the end of its start when nobody wants it any more.
  constexpr Nanos kPatience = std::chrono::seconds(1);
  unit->stop();
  if (!unit->abandoned_ && unit->is_over_start(kPatience)) {
    delete unit;  // NOLINT(cppcoreguidelines-owning-memory)
    return;
  }
  unit->thread_.detach();
  // For ever, and where whoever looks for leaks finds them.
  static runtime::Atomic<KernelUnit*> newest = nullptr;
  unit->stayed_before_ = newest.exchange(unit);
}

void KernelUnit::run(Call& call) {
  auto* const lane = static_cast<Lane*>(lane_here);
  if (lane != nullptr && lane->unit == this && lane->telling && lane->next == nullptr &&
      !anything_waits()) {
    lane->next = &call;
    return;
  }
  call.neighbour = posted_.load(std::memory_order_relaxed);
  while (!posted_.compare_exchange_weak(call.neighbour, &call)) continue;
  bell_.ring(1);
}

std::vector<KernelUnit::Running> KernelUnit::running() const {
  std::vector<Running> running;
  for (std::size_t lane = 0; lane < lanes_.size(); ++lane) {
    if (const auto call = lanes_[lane].running.seen()) running.push_back({*call, lane});
  }
  return running;
}

std::optional<std::vector<Call*>> KernelUnit::abandon(const Running& call) {
  Lane& lane = lanes_.front();
  if (!lane.running.give_up(call.number)) return std::nullopt;
  abandoned_ = true;
  lane.running.stop.request_stop();
  std::vector<Call*> behind;
  while (Call* const each = take_first()) behind.push_back(each);
  return behind;
}

void KernelUnit::request_stop(Call& call) {
  // Before it is looked for: one that begins meanwhile looks at this when it has.
  call.unwanted.exchange(true);
  for (Lane& lane : lanes_) {
    const auto runs = lane.running.seen();
    if (runs && runs->call == &call) lane.running.request_stop(runs->number);
  }
}

/// Null: nothing runs any more.
Call* KernelUnit::wait_for_call(Lane& lane) {
  while (!stopping_) {
    if (lane.next != nullptr) return std::exchange(lane.next, nullptr);
    if (opens_again_.exchange(false)) try_to_open();
    if (anything_waits()) {
      if (Call* const call = take_first()) return call;  // Another lane may have it.
    } else if (!spin(lane)) {
      bell_.sleep_until([this] { return stopping_ || anything_waits(); });
    }
  }
  return nullptr;
}

/// Whether something has come while it could.
bool KernelUnit::spin(Lane& lane) const {
  if (setup_.spin <= Nanos::zero()) return false;
  constexpr int kLooks = 32;  // Between two readings of the clock.
  const Nanos begin = clock_.now();
  Nanos awake{0};
  bool come = false;
  while (!come && awake < setup_.spin) {
    for (int look = 0; look < kLooks && !come; ++look) {
      pause_core();
      come = anything_waits() || stopping_;
    }
    awake = clock_.now() - begin;
  }
  lane.awake += awake;
  return come;
}

/// Null if none waits.
Call* KernelUnit::take_first() {
  const std::lock_guard lock(taking_);
  Call* first = queued_;
  if (first == nullptr) {  // Then those that were posted, turned round.
    for (Call* newest = posted_.exchange(nullptr); newest != nullptr;) {
      Call* const before = std::exchange(newest->neighbour, first);
      first = std::exchange(newest, before);
    }
  }
  if (first == nullptr) return nullptr;
  queued_ = first->neighbour;
  // Another lane may have looked between the two lists.
  if (first->neighbour != nullptr && lanes_.size() > 1) bell_.ring(1);
  return first;
}

void KernelUnit::serve() {
  runtime::begin_thread(name(), setup_.cores);
  for (Lane& lane : lanes_) lane.unit = this;
  tell_stop_of_call(&lanes_.front().running.stop);
  std::vector<runtime::Thread> others;
  try {
    set_up();
    for (std::size_t i = 1; i < lanes_.size(); ++i) {
      others.push_back(runtime::start_thread([this, &lane = lanes_[i]] {
        name_thread(name());
        static_cast<void>(take_priority(setup_.priority));
        serve_calls(lane);
      }));
    }
  } catch (...) {
    stop();  // Those that have begun.
    failure_ = std::current_exception();
    started_.set();
    return;
  }
  started_.set();
  serve_calls(lanes_.front());
  others.clear();
  device_.reset();  // Where it was made, too.
}

/// Until none is to come, or one was given up, which has ended after all.
void KernelUnit::serve_calls(Lane& lane) {
  const runtime::MustNotWait within;
  tell_stop_of_call(&lane.running.stop);
  lane_here = &lane;
  while (Call* const call = wait_for_call(lane)) {
    CallEnd end;
    if (!run_call(lane, *call, end)) break;
    lane.telling = true;
    done_(*call, end);
    lane.telling = false;
  }
  lane.kernels.clear();  // Where they were made: a driver may want its own thread.
}

/// False if it was given up: nobody knows of the call any more; what it holds goes with it.
bool KernelUnit::run_call(Lane& lane, Call& call, CallEnd& end) {
  const Nanos begin = clock_.now();
  lane.running.begin(call, begin);
  const Remote* const remote = remote_;
  const bool lost = lost_;
  // Who wants it no more, or stops the unit, saw this call or is seen here.
  const bool begins = !call.unwanted && !lost && (remote == nullptr || !stopping_);
  lane.paused = Nanos::zero();
  const HearsSlices hears(suspends_calls() ? &lane : nullptr);
  const bool in_phases = !begins || execute(lane, call, end);
  if (!begins) end.outcome = Outcome::kReturned;
  end.at = clock_.now();
  end.busy = end.at - begin - lane.paused;
  if (!in_phases) end.times.execute = end.busy - end.preparing.value_or(Nanos::zero());
  if (!lane.running.end()) return false;
  end.awake = std::exchange(lane.awake, Nanos::zero());
  const bool stopped = lane.running.stop.stop_requested();
  if (stopped) lane.running.stop = std::stop_source();
  const bool unwanted = stopped || call.unwanted;
  const bool late = call.wanted_until && *call.wanted_until <= end.at;  // Nobody takes it now.
  end.excused = lost || unwanted || late || (remote != nullptr && !remote->is_reachable());
  if (unwanted && end.outcome == Outcome::kReturned) end.problem.clear();  // As was asked for.
  return true;
}

void KernelUnit::set_up() {
  remark_ = take_priority(setup_.priority);
  if (setup_.backend != nullptr) {
    device_ = setup_.backend->open(setup_.request);
    device_info_ = device_->info();
    output_memory_ = device_->output_memory();
    const std::string& remark = device_info_->remark;
    if (!remark.empty()) remark_ += (remark_.empty() ? "" : "; ") + remark;
    has_own_clock_ = device_->own_clock() != nullptr;
    remote_ = dynamic_cast<Remote*>(device_.get());
  }
  if (setup_.lanes > 1 && !is_remote()) {
    throw_bad_input(std::to_string(setup_.lanes) +
                    " servers, and a unit that computes here serves one call after the other; take "
                    "`servers` out, or give each its cores as a unit of its own");
  }
  // What is out of reach is prepared once it is not, at the first call.
  if (!setup_.prepare_first || !is_reachable()) return;
  // The first one last, where one program at a time is held.
  for (auto each = setup_.preparations.rbegin(); each != setup_.preparations.rend(); ++each) {
    if (stopping_) return;
    // Others may come, so that one that nobody there has is no failure.
    if (const Support served = serves(*each->workload); !served.ok) {
      remark_ += (remark_.empty() ? "" : "; ") + not_asked_for(*each->workload, served);
      continue;
    }
    Lane& lane = lanes_.front();
    Prepared& made = prepare(lane, *each);
    if (!each->function) run_once(lane, *each, made);
  }
}

Support KernelUnit::serves(const Workload& workload) const {
  if (!is_remote()) return {true, ""};
  const auto its = std::ranges::find(setup_.preparations, &workload, &Preparation::workload);
  if (its != setup_.preparations.end() && its->function) return {true, ""};
  return device_->supports(workload);
}

/// Whether the unit holds both at once.
bool KernelUnit::go_together(const Workload& one, const Workload& other) const {
  if (!setup_.contexts || &one == &other) return true;
  const auto program = setup_.contexts->program_of(one.name);
  return program && program == setup_.contexts->program_of(other.name);
}

KernelUnit::Prepared& KernelUnit::prepare(Lane& lane, const Preparation& preparation) {
  const Workload& workload = *preparation.workload;
  std::erase_if(lane.kernels, [&](const auto& held) {
    return held.first == &workload || !go_together(*held.first, workload);
  });
  Prepared made;
  made.kernel = preparation.function ? std::make_unique<FunctionKernel>(preparation.function)
                                     : device_->prepare(workload, preparation.sample->parameters);
  made.function = dynamic_cast<FunctionKernel*>(made.kernel.get());
  made.own = preparation.function || own_operation(workload) != nullptr;
  return lane.kernels.emplace(&workload, std::move(made)).first->second;
}

/// Some compile at the first run. Its outputs are where those of later calls are: a device's memory
/// is there by then.
void KernelUnit::run_once(Lane& lane, const Preparation& preparation, Prepared& prepared) {
  const Workload& workload = *preparation.workload;
  Call first{.workload = &workload,
             .inputs = {},
             .outputs = std::make_shared<std::vector<Tensor>>(
                 make_tensors(workload.outputs, output_memory_.get())),
             .state = workload.state ? std::make_shared<StateValue>(workload) : nullptr,
             .intended = Outcome::kFailed};
  // And another set of them, for a call while somebody reads those of the one before.
  const auto second = make_tensors(workload.outputs, output_memory_.get());
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

/// @return  Whether its phases were timed; else it has none, and is all execute.
bool KernelUnit::execute(Lane& lane, Call& call, CallEnd& end) {
  end.outcome = call.intended;
  const auto ended = [&](Outcome outcome, const std::string& why) {
    end.outcome = outcome;
    end.problem = call.workload->name + " on " + name() + ": " + why;
  };
  try {
    Prepared& held = prepared(lane, *call.workload, end);
    check_values(call, held.own);
    if (held.function != nullptr && call.state == nullptr) {
      held.function->bind(call.inputs, outputs_of(call));
      held.function->execute(1);
      return false;
    }
    end.version = compute(lane, held, call, end.times);
  } catch (const CallFailed& error) {
    // Who hears that nobody wants it any more may end so.
    ended(call.unwanted ? Outcome::kReturned : Outcome::kFailed, error.what());
  } catch (const Error& error) {
    // The device could not; another may.
    const bool environment = error.code() == ErrorCode::kEnvironment;
    ended(environment ? Outcome::kReturned : Outcome::kFailed, error.what());
    if (environment && device_ != nullptr && device_->is_lost()) lose_device(lane, end);
  } catch (const std::exception& error) {
    ended(Outcome::kFailed, error.what());
  } catch (...) {
    ended(Outcome::kFailed, "an exception of an unknown type");
  }
  return true;
}

/// Other workloads are not to fail for the one whose call ended the device. That one counts as
/// given back, and is not asked for any more once it is so too often.
void KernelUnit::lose_device(Lane& lane, CallEnd& end) {
  lane.kernels.clear();
  device_.reset();  // First: a driver may have one context a process.
  // Outputs in its memory hold the lost one: then it is opened when nobody has any (open_again).
  const bool is_held = output_memory_ != nullptr;
  lost_ = true;
  if (!is_held) try_to_open();
  // The remedy is of a device that is there.
  end.problem.erase(std::min(end.problem.size(), end.problem.rfind("; ")));
  end.problem += lost_ ? "; its device is lost" : "; its device was lost, and is opened again";
}

void KernelUnit::open_again() {
  opens_again_ = true;
  bell_.ring(1);
}

/// Its kernels are prepared when they are called.
void KernelUnit::try_to_open() {
  if (!lost_) return;
  std::string why;
  try {
    device_ = setup_.backend->open(setup_.request);
    const std::string other = other_device(*device_info_, device_->info());
    if (!other.empty()) throw_environment(name() + " has " + other);
    if (auto memory = device_->output_memory()) output_memory_ = std::move(memory);
    lost_ = false;
  } catch (const Error& error) {  // Not yet, then.
    device_.reset();
    why = error.what();
  }
  const std::lock_guard lock(taking_);
  why_lost_ = std::move(why);
}

/// @return  The version of the state that it wrote; 0 if it has none, or is not to count.
std::uint64_t KernelUnit::compute(Lane& lane, Prepared& prepared, Call& call, CallTimes& times) {
  Kernel& kernel = *prepared.kernel;
  kernel.bind(call.inputs, outputs_of(call));
  const Unbinding unbinding{kernel};
  // What is under way elsewhere can be taken back.
  Remote* const remote = remote_;
  const auto withdraw = [&] { remote->withdraw(kernel); };
  std::optional<std::stop_callback<decltype(withdraw)>> withdrawn;
  if (remote != nullptr) withdrawn.emplace(lane.running.stop.get_token(), withdraw);
  if (remote != nullptr && call.wanted_until) {
    remote->expires_in(kernel, *call.wanted_until - clock_.now());
  }
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
  times.execute = executed - uploaded - times.launch.value_or(Nanos::zero()) - lane.paused;
  times.download = clock_.now() - executed;
  if (call.state == nullptr || call.intended != Outcome::kCompleted) return 0;
  static runtime::Atomic<std::uint64_t> versions = 0;
  kernel.commit_state();
  return prepared.version = ++versions;
}

}  // namespace pirt
