#include "scheduler/runtime/live_run.h"

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

#include "characterize/platform/elsewhere.h"
#include "scheduler/runtime/live_units.h"
#include "scheduler/runtime/samples.h"
#include "scheduler/runtime/threads.h"
#include "workloads/catalog/catalog.h"
#include "workloads/catalog/own_list.h"

namespace pirt {
namespace {

/// That are kept of a workload on a unit.
constexpr std::size_t kMostCalls = 4096;
/// What units' threads get at a time where paced units are never caught up with.
constexpr Nanos kGivesWay = std::chrono::microseconds(100);

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

void count_phases(CallPhases& phases, const CallTimes& times) {
  phases.upload.add(times.upload);
  if (times.launch) phases.launch.add(*times.launch);
  phases.execute.add(std::max(times.execute, Nanos::zero()));
  phases.download.add(times.download);
}

/// What was @p made as kernels take it: a list may have a lower capacity than the one that is
/// @p taken.
Tensor as_taken(const Tensor& made, const TensorSpec& taken) {
  if (made.spec().shape == taken.shape) return made.share();
  Tensor list(taken);
  list.set_rows(made.rows());
  std::ranges::copy(made.used_bytes(), list.data());
  return list;
}

class LiveRun final : public Executor, private LiveDriver {
 public:
  LiveRun(const Scenario& scenario, Dispatcher& dispatcher, const LiveOptions& options,
          RunObserver* observer)
      : scenario_(scenario),
        options_(options),
        samples_(scenario.seed),
        dispatcher_(dispatcher),
        time_(scenario, dispatcher,
              observer != nullptr ? std::vector{observer} : std::vector<RunObserver*>(), this,
              units_where(scenario.platform.units, &UnitModel::measured)),
        units_(scenario.platform,
               {.prepare_first = options.prepare_first,
                .time_limit = options.time_limit,
                .stop = options.stop,
                .progress = options.progress,
                .slices = scenario.slices},
               *this) {
    for (const MixState& state : scenario.mix.states) {
      const Workload& workload = find_workload(state.workload);
      check_code_is_here(workload);
      units_.add_state(workload);
    }
  }

  LiveResult run() {
    const Nanos before = clock_.now();
    units_.open();
    start_ = clock_.now();
    result_.set_up = start_ - before;
    {
      std::unique_lock lock(mutex_);
      // Nothing is given to what is out of reach from the beginning.
      units_.look_for_reach();
      time_.begin();
      pace(lock);
      closing_ = true;
    }
    if (options_.calls) options_.calls(calls());
    note_units();
    units_.close();  // Their threads end.
    result_.tally = time_.finish();
    result_.tally.phases = std::move(phases_);
    // What remains was not waited for; it could have started.
    if (result_.stopped) result_.tally.stalled = 0;
    result_.problems = problems_.first();
    result_.failed_calls = problems_.count();
    return std::move(result_);
  }

  /// Behind the mutex, from within what a thread tells the driver.
  void start(JobIndex job, UnitId unit, bool let_in) override {
    if (closing_) {  // Nobody waits for what comes now, nor does what was suspended for it.
      if (let_in) units_.go_on(unit);
      return;
    }
    ++computing_;
    const Firings::TaskPlace& place = time_.firings().place(job);
    const MixTask& task = scenario_.mix.pipelines[place.pipeline].tasks[place.task];
    const Workload& workload = find_workload(task.workload);
    if (task.state && task.inputs.empty()) follow_sequence(*task.state, workload, place);
    Call& call = call_of(job);
    units_.fill(unit, call, workload, task.state, time_.recall(job), start_);
    call.intended = time_.intended(job);
    call.token = job;
    for (const Tensor& each : samples_.of(workload, place.firing)->inputs) {
      call.inputs.push_back(each.share());
    }
    for (const PortInput& port : task.inputs) {
      const Firings::Made& made = port.earlier ? time_.firings().made_earlier(job, port.task)
                                               : time_.firings().made(job, port.task);
      if (made.data == nullptr) continue;  // Of a paced unit.
      call.inputs[port.input] = as_taken((*made.data)[port.output], workload.inputs[port.input]);
    }
    units_.run(unit, call, let_in);
  }
  /// As start.
  void resume(JobIndex /*job*/, UnitId unit) override { units_.go_on(unit); }
  /// As start.
  void recall(JobIndex job, UnitId unit) override { units_.request_stop(unit, call_of(job)); }

 private:
  [[nodiscard]] Nanos now() const { return clock_.now() - start_; }

  /// A recorded sequence that begins anew begins with the state that it was recorded from, as where
  /// it is measured: its inputs fit no other. One that was given back plays its frame once more.
  void follow_sequence(std::size_t state, const Workload& workload,
                       const Firings::TaskPlace& place) {
    const Played playing{place, Samples::frame(workload, place.firing)};
    Played& last = played_.try_emplace(state, playing).first->second;
    if (last.place != place && playing.frame <= last.frame) units_.state(state).restart();
    last = playing;
  }

  void note_units() {
    for (UnitId id = 0; id < scenario_.platform.units.size(); ++id) {
      if (!units_.has(id)) continue;
      const KernelUnit& unit = units_.at(id);
      if (unit.has_own_clock()) result_.own_clocks.push_back(unit.name());
      const Remote* const remote = unit.remote();
      if (remote == nullptr) continue;
      result_.links.emplace(unit.name(), remote->link());
      if (!remote->is_reachable()) result_.out_of_reach.push_back(unit.name());
    }
  }

  [[nodiscard]] std::vector<Preparation> preparations(UnitId unit) override {
    std::vector<Preparation> preparations;
    if (!scenario_.platform.units[unit].measured()) return preparations;
    std::vector<bool> known(scenario_.services.workloads.size(), false);
    for (const auto& pipeline : scenario_.classes) {
      for (const TaskClass& kind : pipeline) {
        if (!contains(kind.eligible, unit) || known[kind.workload]) continue;
        known[kind.workload] = true;
        const Workload& workload = find_workload(scenario_.services.workloads[kind.workload]);
        check_code_is_here(workload);
        // All of its sequence: nothing is made behind the mutex later.
        for (int frame = 0; frame < workload.frames; ++frame) {
          samples_.of(workload, static_cast<std::uint64_t>(frame));
        }
        preparations.push_back({.workload = &workload, .sample = samples_.of(workload, 0)});
      }
    }
    return preparations;
  }

  /// Without units that were abandoned.
  [[nodiscard]] LiveCalls calls() {
    LiveCalls all;
    for (UnitId unit = 0; unit < scenario_.platform.units.size(); ++unit) {
      if (!units_.has(unit) || units_.at(unit).abandoned()) continue;
      all.units.push_back({units_.at(unit).name(), units_.at(unit).device()});
    }
    const std::lock_guard lock(mutex_);
    for (const auto& [of, kept] : kept_) {
      all.series.push_back({scenario_.services.workloads[of.first],
                            scenario_.platform.units[of.second].name, kept.calls()});
    }
    return all;
  }

  /// Tasks that nothing else is there for wait for a unit that may come back; who stops the run
  /// does not.
  [[nodiscard]] bool waits_for_reach() const {
    return !result_.stopped && dispatcher_.counts().queued() > 0 && units_.any_may_come_back();
  }

  /// Lets events happen when their time has come, until there is none and nothing computes.
  void pace(std::unique_lock<runtime::Mutex>& lock) {
    Nanos look = now() + kLookEvery;
    while (true) {
      const Nanos next = closing_ ? Nanos::max() : time_.next();
      if (closing_ && computing_ == 0) return;
      if (now() >= look) {
        look_after(start_ + look);
        look = now() + kLookEvery;
      } else if (next <= now()) {
        time_.advance(now());
        if (telling_ > 0 && time_.next() <= now()) wait_until(lock, now() + kGivesWay);
      } else if (next != Nanos::max() || computing_ > 0 || waits_for_reach()) {
        wait_until(lock, std::min(next, look));
      } else {
        return;
      }
    }
  }

  void wait_until(std::unique_lock<runtime::Mutex>& lock, Nanos until) {
    changed_.wait_until(lock, std::chrono::steady_clock::time_point(start_ + until));
  }

  /// The mutex, for a unit's thread that tells of its call.
  [[nodiscard]] std::unique_lock<runtime::Mutex> turn_to_tell() {
    ++telling_;
    std::unique_lock lock(mutex_);
    --telling_;
    return lock;
  }

  /// Takes units out of service whose call does not end, and hears of signals.
  void look_after(Nanos due) {
    units_.look_for_hung(due);
    units_.look_for_reach();
    const int stops = options_.stop ? options_.stop() : 0;
    if (stops > 0 && !result_.stopped) {
      result_.stopped = true;
      time_.stop(now());
    }
    if (stops >= 2) closing_ = true;
  }

  [[nodiscard]] WorkloadId workload_of(JobIndex job) const {
    const Firings::TaskPlace& place = time_.firings().place(job);
    return scenario_.classes[place.pipeline][place.task].workload;
  }

  /// That of a task that is started.
  Call& call_of(JobIndex job) {
    if (calls_.size() <= job) calls_.resize(job + std::size_t{1});
    if (calls_[job] == nullptr) calls_[job] = std::make_unique<Call>();
    return *calls_[job];
  }

  [[nodiscard]] Expectation expected(UnitId unit, const Call& call) override {
    return {scenario_.services.find(workload_of(static_cast<JobIndex>(call.token)), unit)};
  }
  void add_problem(std::string problem) override { problems_.add(std::move(problem)); }
  void set_unit(UnitId unit, UnitState state) override { time_.set_unit(unit, state, now()); }
  void give_up(UnitId, Call& call, CallEnd end) override {
    const auto job = static_cast<JobIndex>(call.token);
    if (end.outcome == Outcome::kFailed) {
      static_cast<void>(calls_[job].release());
    } else {
      call.let_go();
    }
    if (!end.problem.empty()) problems_.add(std::move(end.problem));
    end_computing(job, {.outcome = end.outcome, .busy = end.busy});
  }

  void slice_ended(UnitId unit, Call& call) override {
    const auto lock = turn_to_tell();
    if (closing_) return units_.go_on(unit);
    const Nanos next = time_.next();
    const bool goes_on = time_.slice_ended(static_cast<JobIndex>(call.token), now());
    if (goes_on) units_.go_on(unit);
    if (time_.next() < next) changed_.notify_all();
  }

  void end_computing(JobIndex job, ComputedEnd end) {
    --computing_;
    time_.finished(job, std::move(end), now());
  }

  void ended(UnitId unit, Call& call, CallEnd& end) override {
    const auto lock = turn_to_tell();
    const auto job = static_cast<JobIndex>(call.token);
    const Firings::TaskPlace place = time_.firings().place(job);
    if (!end.problem.empty()) problems_.add(end.problem);
    const bool completed = end.outcome == Outcome::kCompleted;
    if (completed) call.commit(end);
    if (completed && options_.sink) options_.sink(place, *call.outputs);
    if (completed) count_phases(phases_[{workload_of(job), unit}], end.times);
    if (completed && options_.calls) kept_[{workload_of(job), unit}].add(end.times);
    // Before the firing that made them may be over, and the job another one's.
    const auto outputs = std::exchange(call.outputs, nullptr);
    call.let_go();
    const Nanos next = time_.next();
    // Before it is given to the same unit again.
    if (end.outcome == Outcome::kReturned && !units_.at(unit).is_reachable()) {
      units_.look_for_reach();
    }
    end_computing(job, {.outcome = end.outcome,
                        .busy = end.busy,
                        .preparing = end.preparing,
                        .powered = end.powered(is_elsewhere(scenario_.platform.units[unit])),
                        .data = completed ? outputs : nullptr});
    if (completed && !result_.first_call) result_.first_call = end.busy;
    if (time_.next() < next || computing_ == 0) changed_.notify_all();
  }

  const Scenario& scenario_;
  const LiveOptions& options_;
  runtime::LiveClock clock_;
  Nanos start_{0};

  runtime::Atomic<int> telling_ = 0;  ///< Threads that wait for the mutex to tell of a call.
  runtime::Mutex mutex_;              ///< Guards what follows, once units_ have calls.
  runtime::Condition changed_;
  Samples samples_;
  std::vector<std::unique_ptr<Call>> calls_;  ///< By job.
  struct Played {
    Firings::TaskPlace place;
    std::uint64_t frame = 0;
  };
  std::map<std::size_t, Played> played_;  ///< Of states that play: the last frame, and whose.
  const Dispatcher& dispatcher_;
  VirtualTime time_;
  int computing_ = 0;
  std::map<std::pair<WorkloadId, UnitId>, KeptCalls> kept_;
  std::map<std::pair<WorkloadId, UnitId>, CallPhases> phases_;
  Problems problems_;
  bool closing_ = false;  ///< Nothing starts any more.
  LiveResult result_;

  LiveUnits units_;  ///< Last: their threads use all of it.
};

}  // namespace

LiveResult run_live(const Scenario& scenario, Dispatcher& dispatcher, const LiveOptions& options,
                    RunObserver* observer) {
  return LiveRun(scenario, dispatcher, options, observer).run();
}

}  // namespace pirt
