#include "characterize/worker/measure.h"

#include <fmt/core.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "characterize/statistics/rank_tests.h"
#include "characterize/statistics/statistics.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

constexpr Nanos kBatchTime = std::chrono::milliseconds(1);
constexpr std::int64_t kMostCallsAtOnce = 100'000;
constexpr std::int64_t kMostAskedAtOnce = 16;
constexpr double kClockShare = 0.001;                     // what the clock may cost within a sample
constexpr double kClockBoundShare = 0.01;                 // what invalidates
constexpr double kClockTimes = 1.01 / kClockBoundShare;   // of its doubt, in a batch: a little more
constexpr std::int64_t kMostSimulatedWarmUpCalls = 1000;  // they may take no time at all
constexpr int kMachineSlices = 40;         // of the machine's time, for a device that is slow on it
constexpr std::size_t kEstimateCalls = 5;  // of the warm-up's end, for the size of batches

struct CallTimes {
  Nanos upload{0}, execute{0}, download{0}, call{0};
  std::optional<Nanos> launch;
  bool is_odd = false;  ///< What its stamps say of launching cannot be: `launch` is not there.

  /// As far as the phases have a time of their own.
  [[nodiscard]] Nanos sum() const {
    return upload + launch.value_or(Nanos(0)) + execute + download;
  }
};

/// Whether a device's stamps contradict the clock; counts those that do.
class StampCheck {
 public:
  bool is_odd(std::optional<Nanos> launch, Nanos wall) {
    const bool odd = launch && *launch > wall;
    ++executions_;
    if (odd) {
      ++odd_;
      last_ = {*launch, wall};
    }
    return odd;
  }
  [[nodiscard]] std::int64_t odd() const { return odd_; }
  /// @throws Error{kEnvironment} unless most are right.
  void check() const {
    if (2 * odd_ <= executions_) return;
    throw_environment(
        fmt::format("the device's time stamps say that launching took {} ns of an execution of {} "
                    "ns, and the like in {} of {}; its driver's profiling cannot be trusted",
                    last_.first.count(), last_.second.count(), odd_, executions_));
  }

 private:
  std::int64_t executions_ = 0, odd_ = 0;
  std::pair<Nanos, Nanos> last_;
};

/// What launching takes on a device that has to be asked: its share of calls of its own, since
/// asking takes time, and what disturbs such a call makes all of it longer; it is a part of each
/// execution.
class AskedLaunches {
 public:
  /// @param times  A sample is the mean of so many calls.
  void ask(Kernel& kernel, const Clock& clock, std::int64_t times, StampCheck& stamps) {
    Nanos launches{0};
    const Nanos start = clock.now();
    for (std::int64_t i = 0; i < times; ++i) {
      const auto launch = kernel.stamped_launch();
      if (!launch) return;
      launches += *launch;
    }
    const Nanos wall = clock.now() - start;
    if (stamps.is_odd(launches, wall)) return;
    shares_.push_back(wall.count() > 0 ? to_s(launches) / to_s(wall) : 0);
  }
  [[nodiscard]] bool any() const { return !shares_.empty(); }
  /// Of executions, the part that is launching.
  [[nodiscard]] std::vector<Nanos> part_of(std::vector<Nanos> executions) const {
    const double share = any() ? median_of(shares_) : 0;
    for (Nanos& each : executions) {
      each = Nanos(std::llround(share * static_cast<double>(each.count())));
    }
    return executions;
  }
  /// Executions without it.
  [[nodiscard]] std::vector<Nanos> taken_off(std::vector<Nanos> executions) const {
    const auto launches = part_of(executions);
    for (std::size_t i = 0; i < launches.size(); ++i) executions[i] -= launches[i];
    return executions;
  }

 private:
  std::vector<double> shares_;
};

/// How the phases of one kernel are sampled, decided after the warm-up.
struct Plan {
  std::int64_t call = 1;    ///< Calls a batch.
  std::int64_t upload = 0;  ///< Own batch; 0 = timed within the call.
  std::int64_t execute = 0;
  std::int64_t download = 0;
};

class Sampler {
 public:
  Sampler(Kernel& kernel, const PhaseClocks& clocks, std::span<const Phase> phases,
          const PlayedCalls& sequence)
      : kernel_(kernel),
        clocks_(clocks),
        clock_(clocks.clock),
        quality_(clocks.quality),
        sequence_(sequence) {
    has_upload_ = std::ranges::find(phases, Phase::kUpload) != phases.end();
    has_download_ = std::ranges::find(phases, Phase::kDownload) != phases.end();
  }

  void warm_up(const SamplingOptions& options) {
    const bool simulated = quality_.cost_ns == 0;
    std::vector<CallTimes> latest;
    CallTimes sum;
    std::int64_t calls = 0;
    const Nanos start = clock_.now();
    for (; calls < options.warm_up_calls || (clock_.now() - start < options.warm_up &&
                                             !(simulated && calls == kMostSimulatedWarmUpCalls));
         ++calls) {
      if (latest.size() == kEstimateCalls) latest.erase(latest.begin());
      latest.push_back(timed_call());
      for (const auto part :
           {&CallTimes::upload, &CallTimes::execute, &CallTimes::download, &CallTimes::call}) {
        sum.*part += latest.back().*part;
      }
      if (sequence_.next) sequence_.next();
      if (clocks_.on_sample) clocks_.on_sample(0);
    }
    if (latest.empty()) return;
    // Single calls tell nothing where the clock stands still meanwhile; all together do.
    const auto estimate = [&](Nanos CallTimes::*member) {
      std::vector<Nanos> times;
      for (const CallTimes& call : latest) times.push_back(call.*member);
      const Nanos typical = median(times);
      return typical < quality_.resolution ? std::max(typical, sum.*member / calls) : typical;
    };
    plan_.call = batch(estimate(&CallTimes::call));
    plan_.upload = own_batch(Phase::kUpload, estimate(&CallTimes::upload));
    plan_.execute = own_batch(Phase::kExecute, estimate(&CallTimes::execute));
    plan_.download = own_batch(Phase::kDownload, estimate(&CallTimes::download));
  }

  void sample() {
    const Nanos processor = processor_time();
    if (plan_.call == 1) {
      keep(timed_call());
    } else {
      sample_call_batch();
    }
    if (clocks_.processor != nullptr) cpu_.push_back((processor_time() - processor) / plan_.call);
    if (has_upload_ && plan_.upload != 0) {
      uploads_.push_back(timed(Phase::kUpload, plan_.upload, [this] { kernel_.upload(); }));
    }
    if (!execute_is_call() && plan_.execute != 0) sample_execute_batch();
    if (has_download_ && plan_.download != 0) {
      downloads_.push_back(timed(Phase::kDownload, plan_.download, [this] { kernel_.download(); }));
    }
    asked_.ask(kernel_, clock_, asked_batch(), stamps_);
    if (sequence_.next) sequence_.next();
  }

  [[nodiscard]] const std::vector<Nanos>& calls() const { return calls_; }
  void check_stamps() const { stamps_.check(); }

  [[nodiscard]] PhaseSamples samples_of(Phase phase) const {
    PhaseSamples found = times_of(phase);
    const auto bounds = bounds_.find(phase);
    if (bounds != bounds_.end()) found.bound = median(bounds->second);
    if (phase == Phase::kLaunch || phase == Phase::kExecute) found.odd_stamps = stamps_.odd();
    return found;
  }

 private:
  [[nodiscard]] PhaseSamples times_of(Phase phase) const {
    const auto size = [this](std::int64_t own) { return own != 0 ? own : plan_.call; };
    switch (phase) {
      case Phase::kUpload:
        return {phase, uploads_, size(plan_.upload)};
      case Phase::kLaunch:
        if (asked_.any()) return {phase, asked_.part_of(executes_), execute_batch()};
        return {phase, launches_, execute_batch()};
      case Phase::kExecute:
        return {phase,
                asked_.taken_off(executes_),
                execute_batch(),
                {},
                execute_is_call() && stamps_.odd() == 0 ? cpu_ : std::vector<Nanos>()};
      case Phase::kDownload:
        return {phase, downloads_, size(plan_.download)};
      case Phase::kCall:
        return {phase, calls_, plan_.call, {}, cpu_};
      case Phase::kDeviceInit:
      case Phase::kPrepare:
        break;
    }
    return {phase, {}, 1};
  }

  [[nodiscard]] Nanos processor_time() const {
    return clocks_.processor == nullptr ? Nanos(0) : clocks_.processor->now();
  }

  /// Without transfers a call is its execution: one timing serves both.
  [[nodiscard]] bool execute_is_call() const {
    return !has_upload_ && !has_download_ && !is_mixed();
  }

  /// Whether several clocks tell the phases of a call.
  [[nodiscard]] bool is_mixed() const { return !clocks_.measured.empty(); }
  /// Whether the clock that tells the execution goes on while it launches.
  [[nodiscard]] bool launches_within_execute() const {
    return clocks_.is_measured(Phase::kLaunch) == clocks_.is_measured(Phase::kExecute);
  }
  [[nodiscard]] const Clock& clock_of(Phase phase) const {
    return clocks_.is_measured(phase) && clocks_.machine != nullptr ? *clocks_.machine : clock_;
  }
  [[nodiscard]] const ClockQuality& quality_of(Phase phase) const {
    return clocks_.is_measured(phase) ? clocks_.machine_quality : quality_;
  }

  [[nodiscard]] std::int64_t execute_batch() const {
    return plan_.execute != 0 && !execute_is_call() ? plan_.execute : plan_.call;
  }

  /// As a batch, but for the shortest calls, whose launches would take longer than all the rest.
  [[nodiscard]] std::int64_t asked_batch() const {
    return std::min(execute_batch(), kMostAskedAtOnce);
  }

  /// A batch's phases cannot be told apart by several clocks.
  [[nodiscard]] std::int64_t batch(Nanos estimate) const {
    if (quality_.cost_ns <= 0 || is_mixed()) return 1;
    return sequence_.frames > 1 ? fewest_calls(estimate) : batch_size(estimate, quality_);
  }

  /// Of a sequence: a kernel may keep what it made of the frame before (plan_path its map), so that
  /// calls on one frame again and again are not those of a robot.
  [[nodiscard]] std::int64_t fewest_calls(Nanos estimate) const {
    const double least_ns =
        std::max(quality_.cost_ns / kClockShare,
                 static_cast<double>(quality_.resolution.count()) * kClockTimes);
    const auto call_ns = static_cast<double>(std::max<std::int64_t>(1, estimate.count()));
    return std::min(batch_size(estimate, quality_),
                    static_cast<std::int64_t>(std::ceil(least_ns / call_ns)));
  }

  /// Phases that are long against the clock are timed within single calls, where they belong
  /// together; the others on their own.
  [[nodiscard]] std::int64_t own_batch(Phase phase, Nanos estimate) const {
    const ClockQuality& quality = quality_of(phase);
    const bool clock_shows =
        quality.cost_ns > kClockShare * static_cast<double>(estimate.count()) ||
        is_clock_bound(estimate, 1, quality);
    if (plan_.call == 1 && !clock_shows) return 0;
    return quality.cost_ns > 0 ? batch_size(estimate, quality) : 1;
  }

  CallTimes timed_call() {
    if (is_mixed()) return call_by_phases();
    CallTimes times;
    const Nanos start = clock_.now();
    kernel_.upload();
    const Nanos uploaded = clock_.now();
    times.launch = kernel_.execute(1);
    const Nanos executed = clock_.now();
    kernel_.download();
    const Nanos end = clock_.now();
    judge_launch(times, executed - uploaded);
    times.upload = uploaded - start;
    times.execute = executed - uploaded - times.launch.value_or(Nanos(0));
    times.download = end - executed;
    times.call = end - start;
    return times;
  }

  /// Each by the clock that tells it.
  CallTimes call_by_phases() {
    CallTimes times;
    times.upload = timed(Phase::kUpload, 1, [this] { kernel_.upload(); });
    times.execute =
        timed(Phase::kExecute, 1, [this, &times] { times.launch = kernel_.execute(1); });
    if (launches_within_execute()) {
      judge_launch(times, times.execute);
      times.execute -= times.launch.value_or(Nanos(0));
    }
    times.download = timed(Phase::kDownload, 1, [this] { kernel_.download(); });
    times.call = times.sum();
    return times;
  }

  void judge_launch(CallTimes& times, Nanos wall) {
    times.is_odd = stamps_.is_odd(times.launch, wall);
    if (times.is_odd) times.launch.reset();
  }

  /// What the device says of the call that has just ended. The call's bound is made of its phases',
  /// and of the time of those that have none.
  void keep_bounds(const CallTimes& times) {
    Nanos least{0};
    bool any = false;
    for (const auto& [phase, time] : {std::pair(Phase::kUpload, times.upload),
                                      {Phase::kLaunch, times.launch.value_or(Nanos(0))},
                                      {Phase::kExecute, times.execute},
                                      {Phase::kDownload, times.download}}) {
      const auto bound = kernel_.bound(phase);
      if (bound) bounds_[phase].push_back(*bound);
      any = any || bound.has_value();
      least += bound.value_or(time);
    }
    if (any) bounds_[Phase::kCall].push_back(least);
  }

  void keep(const CallTimes& times) {
    keep_bounds(times);
    calls_.push_back(times.call);
    if (has_upload_ && plan_.upload == 0) uploads_.push_back(times.upload);
    if (has_download_ && plan_.download == 0) downloads_.push_back(times.download);
    if ((plan_.execute == 0 || execute_is_call()) && !times.is_odd) {
      executes_.push_back(times.execute);
      if (times.launch) launches_.push_back(*times.launch);
    }
  }

  template <typename Step>
  Nanos timed(Phase phase, std::int64_t repeats, Step step) {
    const Clock& clock = clock_of(phase);
    const Nanos start = clock.now();
    for (std::int64_t i = 0; i < repeats; ++i) step();
    return (clock.now() - start) / repeats;
  }

  void execute_once(std::optional<Nanos>& launches) {
    if (const auto launch = kernel_.execute(1)) launches = launches.value_or(Nanos(0)) + *launch;
  }

  void keep_execute(Nanos wall, std::optional<Nanos> launches, std::int64_t repeats) {
    if (launches) *launches /= repeats;
    const bool within = launches_within_execute();
    if (within && stamps_.is_odd(launches, wall)) return;
    executes_.push_back(within ? wall - launches.value_or(Nanos(0)) : wall);
    if (launches) launches_.push_back(*launches);
  }

  void sample_call_batch() {
    std::optional<Nanos> launches;
    const Nanos call = timed(Phase::kCall, plan_.call, [&] {
      kernel_.upload();
      execute_once(launches);
      kernel_.download();
    });
    calls_.push_back(call);
    if (execute_is_call()) keep_execute(call, launches, plan_.call);
  }

  void sample_execute_batch() {
    std::optional<Nanos> launches;
    const Nanos wall = timed(Phase::kExecute, plan_.execute, [&] { execute_once(launches); });
    keep_execute(wall, launches, plan_.execute);
  }

  Kernel& kernel_;
  const PhaseClocks& clocks_;
  const Clock& clock_;
  ClockQuality quality_;
  const PlayedCalls& sequence_;
  bool has_upload_ = false;
  bool has_download_ = false;
  Plan plan_;
  std::vector<Nanos> uploads_, launches_, executes_, downloads_, calls_, cpu_;
  AskedLaunches asked_;
  StampCheck stamps_;
  std::map<Phase, std::vector<Nanos>> bounds_;
};

void sample_for(Sampler& sampler, const PhaseClocks& clocks, const SamplingOptions& options,
                std::int64_t frames) {
  const Clock& machine = clocks.machine != nullptr ? *clocks.machine : clocks.clock;
  const Nanos start = clocks.clock.now();
  const Nanos machine_start = machine.now();
  while (true) {
    sampler.sample();
    const auto samples = static_cast<std::int64_t>(sampler.calls().size());
    if (clocks.on_sample) clocks.on_sample(samples);
    const Nanos spent = clocks.clock.now() - start;
    const Nanos machine_spent = machine.now() - machine_start;
    if (machine_spent >= options.limit || samples >= options.max_samples) return;
    const bool whole = samples % frames == 0;
    const bool long_enough =
        spent >= options.slice || machine_spent >= kMachineSlices * options.slice;
    if (whole && long_enough && samples >= options.min_samples) return;
  }
}

}  // namespace

Nanos ProcessorClock::now() const {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return std::chrono::seconds(time.tv_sec) + Nanos(time.tv_nsec);
}

namespace {

/// Of a clock that stands still for hundreds of readings: those that its second step takes.
ClockQuality measure_coarse_clock(const Clock& clock) {
  constexpr int kMostReadings = 1'000'000;
  Nanos last = clock.now();
  Nanos step{0};
  int readings = 0;
  for (int steps = 0; steps < 2; ++steps) {  // the first is only where the second begins
    const Nanos begin = last;
    readings = 0;
    while (last == begin && readings < kMostReadings) {
      last = clock.now();
      ++readings;
    }
    step = last - begin;
  }
  return {std::max(0.1, static_cast<double>(step.count()) / readings),
          step > Nanos(0) ? step : Nanos(std::chrono::seconds(1))};
}

}  // namespace

ClockQuality measure_clock(const Clock& clock) {
  constexpr int kRounds = 21;
  constexpr int kReadings = 500;
  std::vector<Nanos> rounds;
  Nanos smallest = std::chrono::seconds(1);
  for (int i = 0; i < kRounds; ++i) {
    const Nanos start = clock.now();
    Nanos last = start;
    for (int j = 1; j < kReadings; ++j) {
      const Nanos now = clock.now();
      if (now > last) smallest = std::min(smallest, now - last);
      last = now;
    }
    rounds.push_back(last - start);
  }
  if (median(rounds) == Nanos(0)) return measure_coarse_clock(clock);
  // The smallest step seen is bounded by the cost itself on a fine clock; that is the finest that
  // can be told apart.
  return {static_cast<double>(median(rounds).count()) / (kReadings - 1), smallest};
}

std::vector<PhaseSamples> sample_calls(Kernel& kernel, const Clock& clock,
                                       const ClockQuality& quality, std::span<const Phase> phases,
                                       const SamplingOptions& options,
                                       const PlayedCalls& sequence) {
  return sample_calls(kernel, PhaseClocks{.clock = clock, .quality = quality}, phases, options,
                      sequence);
}

std::vector<PhaseSamples> sample_calls(Kernel& kernel, const PhaseClocks& clocks,
                                       std::span<const Phase> phases,
                                       const SamplingOptions& options,
                                       const PlayedCalls& sequence) {
  Sampler sampler(kernel, clocks, phases, sequence);
  sampler.warm_up(options);
  sample_for(sampler, clocks, options, sequence.frames);
  sampler.check_stamps();
  const bool simulated = clocks.quality.cost_ns == 0;
  std::vector<PhaseSamples> result;
  for (const Phase phase : phases) {
    if (clocks.unknown.contains(phase)) continue;
    if (phase == Phase::kCall && !clocks.unknown.empty()) continue;
    PhaseSamples samples = sampler.samples_of(phase);
    const auto is_zero = [](Nanos t) { return t.count() == 0; };
    const bool absent =
        samples.samples.empty() || (simulated && std::ranges::all_of(samples.samples, is_zero));
    if (!absent) result.push_back(std::move(samples));
  }
  return result;
}

PhaseSamples sample_executions(Kernel& kernel, const Clock& clock, std::int64_t samples,
                               const std::function<void()>& before, const PlayedCalls& sequence) {
  PhaseSamples taken{Phase::kExecute, {}, 1};
  AskedLaunches asked;
  StampCheck stamps;
  for (std::int64_t i = 0; i < samples; ++i) {
    kernel.upload();
    before();
    const Nanos start = clock.now();
    const auto launch = kernel.execute(1);
    const Nanos wall = clock.now() - start;
    if (!stamps.is_odd(launch, wall)) {
      taken.samples.push_back(wall - launch.value_or(Nanos(0)));
    }
    kernel.download();
    asked.ask(kernel, clock, 1, stamps);
    if (sequence.next) sequence.next();
  }
  stamps.check();
  taken.odd_stamps = stamps.odd();
  taken.samples = asked.taken_off(std::move(taken.samples));
  return taken;
}

std::int64_t batch_size(Nanos one_call, const ClockQuality& quality) {
  const Nanos least = std::max(kBatchTime, Nanos(std::llround(kClockTimes * quality.doubt_ns())));
  if (one_call >= least) return 1;
  const std::int64_t call_ns = std::max<std::int64_t>(1, one_call.count());
  return std::min(kMostCallsAtOnce, (least.count() + call_ns - 1) / call_ns);
}

bool is_clock_bound(Nanos median_sample, std::int64_t batch, const ClockQuality& quality) {
  if (quality.cost_ns <= 0) return false;
  const double timed_ns = static_cast<double>(median_sample.count()) * static_cast<double>(batch);
  return quality.doubt_ns() > kClockBoundShare * std::max(timed_ns, 1.0);
}

}  // namespace pirt
