#include "scheduler/runtime/live_run.h"

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

#include "characterize/platform/unit_request.h"
#include "scheduler/runtime/kernel_unit.h"
#include "workloads/base/error.h"
#include "workloads/catalog.h"
#include "workloads/images.h"
#include "workloads/registry.h"

namespace pirt {
namespace {

constexpr std::size_t kMostProblems = 10;

/// Inputs that no port feeds, and the parameters: of each workload its recorded sequence.
class Samples {
 public:
  explicit Samples(std::uint64_t seed) : seed_(seed), images_(generated_images(seed)) {}

  /// @param firing  Number of the firing: which frame of the sequence.
  const std::shared_ptr<const Data>& of(const Workload& workload, std::uint64_t firing) {
    auto& frames = frames_[&workload];
    if (frames.empty()) {
      for (int frame = 0; frame < workload.frames; ++frame) {
        frames.push_back(std::make_shared<const Data>(
            workload.make_data({.seed = seed_, .images = images_.get(), .frame = frame})));
      }
    }
    return frames[firing % frames.size()];
  }

 private:
  std::uint64_t seed_;
  std::unique_ptr<ImageSource> images_;
  std::map<const Workload*, std::vector<std::shared_ptr<const Data>>> frames_;
};

/// Output tensors that nobody reads any more are written again.
class OutputPool {
 public:
  std::shared_ptr<std::vector<Tensor>> take(const Workload& workload) {
    auto& pool = pools_[&workload];
    for (const auto& each : pool) {
      if (each.use_count() == 1) return each;
    }
    return pool.emplace_back(std::make_shared<std::vector<Tensor>>(make_tensors(workload.outputs)));
  }

 private:
  std::map<const Workload*, std::vector<std::shared_ptr<std::vector<Tensor>>>> pools_;
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
      states_.push_back(std::make_unique<StateValue>(find_workload(state.workload)));
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
    Call call{.workload = &workload,
              .inputs = {},
              .outputs = outputs_.take(workload),
              .state = task.state ? states_[*task.state].get() : nullptr,
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
          make_unit_request(scenario_.platform, model, ""), *backend, preparations(unit),
          options_.prepare_first, [this](Call& call, CallEnd end) { ended(call, std::move(end)); });
    }
    for (const auto& [unit, each] : units_) {
      each->wait_until_ready();
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

  /// Lets events happen when their time has come, until none is left and nothing computes.
  void pace(std::unique_lock<std::mutex>& lock) {
    while (true) {
      const Nanos next = time_.next();
      if (next <= now()) {
        time_.advance(now());
      } else if (next != Nanos::max()) {
        changed_.wait_until(lock, std::chrono::steady_clock::time_point(start_ + next));
      } else if (computing_ > 0) {
        changed_.wait(lock);
      } else {
        return;
      }
    }
  }

  /// From a unit's thread.
  void ended(Call& call, CallEnd end) {
    const std::lock_guard lock(mutex_);
    const auto job = static_cast<JobIndex>(call.token);
    const Firings::Place place = time_.firings().place(job);
    if (!end.problem.empty()) {
      ++result_.failed_calls;
      if (result_.problems.size() < kMostProblems) result_.problems.push_back(end.problem);
    }
    const bool completed = end.outcome == Outcome::kCompleted;
    if (completed && options_.sink) options_.sink(place, *call.outputs);
    call.inputs.clear();  // Before the firing that made them may be over.
    --computing_;
    const Nanos next = time_.next();
    time_.finished(job, end.outcome, end.busy, completed ? call.outputs : nullptr, now());
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
  std::vector<std::unique_ptr<StateValue>> states_;
  VirtualTime time_;
  int computing_ = 0;
  LiveResult result_;

  std::map<UnitId, std::unique_ptr<KernelUnit>> units_;  ///< Last: their threads use all of it.
};

}  // namespace

LiveResult run_live(const Scenario& scenario, Dispatcher& dispatcher, const LiveOptions& options,
                    RunObserver* observer) {
  return LiveRun(scenario, dispatcher, options, observer).run();
}

}  // namespace pirt
