#include "scheduler/runtime/live_run.h"

#include <algorithm>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

#include "characterize/platform/unit_request.h"
#include "scheduler/runtime/kernel_unit.h"
#include "scheduler/runtime/output_pool.h"
#include "scheduler/runtime/samples.h"
#include "scheduler/runtime/time_limit.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

constexpr std::size_t kMostProblems = 10;
/// That are kept of a workload on a unit.
constexpr std::size_t kMostCalls = 4096;
/// How often calls are looked at that may run too long, and whether the run shall stop.
constexpr Nanos kLook = std::chrono::milliseconds(50);

/// Every stride-th of the calls; where that is too many, every second of them from then on.
class KeptCalls {
 public:
  void add(const CallTimes& times) {
    if (seen_++ % stride_ != 0) return;
    if (calls_.size() == kMostCalls) {
      for (std::size_t i = 0; i < kMostCalls / 2; ++i) calls_[i] = calls_[2 * i];
      calls_.resize(kMostCalls / 2);
      stride_ *= 2;
    }
    calls_.push_back(times);
  }
  [[nodiscard]] const std::vector<CallTimes>& calls() const { return calls_; }

 private:
  std::vector<CallTimes> calls_;
  std::uint64_t seen_ = 0, stride_ = 1;
};

class LiveRun final : public Executor {
 public:
  LiveRun(const Scenario& scenario, Dispatcher& dispatcher, const LiveOptions& options,
          RunObserver* observer)
      : scenario_(scenario),
        options_(options),
        samples_(scenario.seed),
        time_(scenario, dispatcher, observer, this, computed_units(scenario)) {
    for (const MixState& state : scenario.mix.states) {
      states_.push_back(std::make_shared<StateValue>(find_workload(state.workload)));
    }
  }

  LiveResult run() {
    const Nanos before = clock_.now();
    set_up();
    start_ = clock_.now();
    result_.set_up = start_ - before;
    {
      std::unique_lock lock(mutex_);
      time_.begin();
      pace(lock);
    }
    for (auto& [unit, each] : units_) {
      if (each->abandoned()) KernelUnit::leave(std::move(each));
    }
    if (options_.calls) options_.calls(calls());
    units_.clear();  // Their threads end.
    result_.tally = time_.finish();
    return std::move(result_);
  }

  /// Behind the mutex, from within what a thread tells the driver.
  void start(JobIndex job, UnitId unit) override {
    ++computing_;
    const Firings::Place& place = time_.firings().place(job);
    const MixTask& task = scenario_.mix.pipelines[place.pipeline].tasks[place.task];
    const Workload& workload = find_workload(task.workload);
    if (task.state && task.inputs.empty()) follow_sequence(*task.state, workload, place.firing);
    Call call{.workload = &workload,
              .inputs = {},
              .outputs = outputs_.take(workload),
              .state = task.state ? states_[*task.state] : nullptr,
              .intended = time_.intended(job),
              .token = job};
    for (const Tensor& each : samples_.of(workload, place.firing)->inputs) {
      call.inputs.push_back(each.share());
    }
    for (const PortInput& port : task.inputs) {
      const Firings::Made& made = port.earlier ? time_.firings().made_earlier(job, port.task)
                                               : time_.firings().made(job, port.task);
      if (made.data == nullptr) continue;  // Of a paced unit.
      call.inputs[port.input] = (*made.data)[port.output].share();
    }
    units_.at(unit)->run(std::move(call));
  }

 private:
  static UnitMask computed_units(const Scenario& scenario) {
    UnitMask mask = 0;
    for (UnitId unit = 0; unit < scenario.platform.units.size(); ++unit) {
      if (scenario.platform.units[unit].measured()) mask |= unit_bit(unit);
    }
    return mask;
  }

  [[nodiscard]] Nanos now() const { return clock_.now() - start_; }

  /// A recorded sequence that begins anew begins with the state that it was recorded from, as where
  /// it is measured: its inputs fit no other.
  void follow_sequence(std::size_t state, const Workload& workload, std::uint64_t firing) {
    const std::uint64_t frame = Samples::frame(workload, firing);
    const auto [last, first_time] = played_.try_emplace(state, frame);
    if (!first_time && frame <= last->second) states_[state]->restart();
    last->second = frame;
  }

  void set_up() {
    const auto say = [this](const std::string& line) {
      if (options_.progress) options_.progress(line);
    };
    for (UnitId unit = 0; unit < scenario_.platform.units.size(); ++unit) {
      const UnitModel& model = scenario_.platform.units[unit];
      if (!model.measured()) continue;
      const auto backend = &find_backend(model.backend);
      say("opening " + model.name);
      units_[unit] = std::make_unique<KernelUnit>(
          UnitSetup{.request = make_unit_request(scenario_.platform, model, ""),
                    .backend = backend,
                    .preparations = preparations(unit),
                    .prepare_first = options_.prepare_first,
                    .contexts = model.contexts.has_value()},
          [this](Call& call, const CallEnd& end) { ended(call, end); });
    }
    for (const auto& [unit, each] : units_) {
      each->wait_until_ready();
      if (each->has_own_clock()) result_.own_clocks.push_back(each->name());
      say(each->name() + " is ready");
    }
  }

  std::vector<Preparation> preparations(UnitId unit) {
    std::vector<Preparation> preparations;
    std::vector<bool> known(scenario_.services.workloads.size(), false);
    for (const auto& pipeline : scenario_.classes) {
      for (const TaskClass& kind : pipeline) {
        if (!contains(kind.eligible, unit) || known[kind.workload]) continue;
        known[kind.workload] = true;
        const Workload& workload = find_workload(scenario_.services.workloads[kind.workload]);
        preparations.push_back({.workload = &workload, .sample = samples_.of(workload, 0)});
      }
    }
    return preparations;
  }

  /// Without units that were abandoned.
  [[nodiscard]] LiveCalls calls() {
    LiveCalls all;
    for (const auto& [unit, each] : units_) {
      if (each != nullptr) all.units.push_back({each->name(), *each->device()});
    }
    const std::lock_guard lock(mutex_);
    for (const auto& [of, kept] : kept_) {
      all.series.push_back({scenario_.services.workloads[of.first],
                            scenario_.platform.units[of.second].name, kept.calls()});
    }
    return all;
  }

  /// Lets events happen when their time has come, until none is left and nothing computes.
  void pace(std::unique_lock<std::mutex>& lock) {
    Nanos look = now() + kLook;
    while (true) {
      const Nanos next = time_.next();
      if (now() >= look) {
        if (!goes_on()) return;
        look = now() + kLook;
      } else if (next <= now()) {
        time_.advance(now());
      } else if (next != Nanos::max() || computing_ > 0) {
        const Nanos until = std::min(next, look);
        changed_.wait_until(lock, std::chrono::steady_clock::time_point(start_ + until));
      } else {
        return;
      }
    }
  }

  /// Takes units out of service whose call does not end. False: nothing is waited for any more.
  bool goes_on() {
    for (auto& [unit, each] : units_) {
      const auto call = each->running();
      if (call && clock_.now() - call->since > limit_of(unit, call->token)) abandon(unit, *call);
    }
    const int stops = options_.stop ? options_.stop() : 0;
    if (stops > 0 && !result_.stopped) {
      result_.stopped = true;
      time_.stop(now());
    }
    return stops < 2;
  }

  [[nodiscard]] Nanos limit_of(UnitId unit, std::uint64_t token) const {
    if (options_.time_limit) return *options_.time_limit;
    const Firings::Place& place = time_.firings().place(static_cast<JobIndex>(token));
    const WorkloadId workload = scenario_.classes[place.pipeline][place.task].workload;
    return time_limit(*scenario_.services.find(workload, unit), units_.at(unit)->has_own_clock());
  }

  /// What the call has is never used again; its state is that of before.
  void abandon(UnitId unit, const KernelUnit::Running& call) {
    KernelUnit& each = *units_.at(unit);
    const auto behind = each.abandon(call.token);
    if (!behind) return;
    const auto job = static_cast<JobIndex>(call.token);
    const Firings::Place place = time_.firings().place(job);
    const MixTask& task = scenario_.mix.pipelines[place.pipeline].tasks[place.task];
    if (task.state) states_[*task.state] = std::make_shared<StateValue>(*states_[*task.state]);
    const Nanos ran = clock_.now() - call.since;
    add_problem(overdue(task.workload, each.name(), ran));
    time_.set_unit(unit, UnitState::kDown, now());
    end_computing(job, {.outcome = Outcome::kFailed, .busy = ran});
    for (const std::uint64_t token : *behind) {
      end_computing(static_cast<JobIndex>(token), {.outcome = Outcome::kReturned});
    }
  }

  void end_computing(JobIndex job, ComputedEnd end) {
    --computing_;
    time_.finished(job, std::move(end), now());
  }

  void add_problem(const std::string& problem) {
    ++result_.failed_calls;
    if (result_.problems.size() < kMostProblems) result_.problems.push_back(problem);
  }

  /// From a unit's thread.
  void ended(Call& call, const CallEnd& end) {
    const std::lock_guard lock(mutex_);
    const auto job = static_cast<JobIndex>(call.token);
    const Firings::Place place = time_.firings().place(job);
    if (!end.problem.empty()) add_problem(end.problem);
    const bool completed = end.outcome == Outcome::kCompleted;
    if (completed && call.state) call.state->commit(end.version);
    if (completed && options_.sink) options_.sink(place, *call.outputs);
    if (completed && options_.calls) {
      const WorkloadId workload = scenario_.classes[place.pipeline][place.task].workload;
      kept_[{workload, time_.unit_of(job)}].add(end.times);
    }
    call.inputs.clear();  // Before the firing that made them may be over.
    const Nanos next = time_.next();
    end_computing(job, {.outcome = end.outcome,
                        .busy = end.busy,
                        .preparing = end.preparing,
                        .data = completed ? call.outputs : nullptr});
    if (completed && !result_.first_call) result_.first_call = end.busy;
    if (time_.next() < next || computing_ == 0) changed_.notify_all();
  }

  const Scenario& scenario_;
  const LiveOptions& options_;
  MachineClock clock_;
  Nanos start_{0};

  std::mutex mutex_;  ///< Guards what follows, once units_ have calls.
  std::condition_variable changed_;
  Samples samples_;
  OutputPool outputs_;
  std::vector<std::shared_ptr<StateValue>> states_;
  std::map<std::size_t, std::uint64_t> played_;  ///< Of states_ that play: the last frame.
  VirtualTime time_;
  int computing_ = 0;
  std::map<std::pair<WorkloadId, UnitId>, KeptCalls> kept_;
  LiveResult result_;

  std::map<UnitId, std::unique_ptr<KernelUnit>> units_;  ///< Last: their threads use all of it.
};

}  // namespace

LiveResult run_live(const Scenario& scenario, Dispatcher& dispatcher, const LiveOptions& options,
                    RunObserver* observer) {
  return LiveRun(scenario, dispatcher, options, observer).run();
}

}  // namespace pirt
