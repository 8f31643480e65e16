#include "characterize/worker/measure.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "characterize/statistics/statistics.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

constexpr Nanos kBatchTime = std::chrono::milliseconds(1);
constexpr std::int64_t kLargestBatch = 100'000;
constexpr double kClockShare = 0.001;      // what the clock may cost within a sample
constexpr double kClockBoundShare = 0.01;  // what invalidates
constexpr std::size_t kFewestWarmUpCalls = 2;
constexpr std::size_t kMostSimulatedWarmUpCalls = 1000;  // they may take no time at all
constexpr std::size_t kEstimateCalls = 5;  // of the warm-up's end, for the size of batches

struct CallTimes {
  Nanos upload{0}, execute{0}, download{0}, call{0};
  std::optional<Nanos> launch;
};

void check_launch(std::optional<Nanos> launch, Nanos wall) {
  if (launch && *launch > wall) {
    throw_environment(
        fmt::format("the device's time stamps say that launching took {} ns of an execution of {} "
                    "ns; its driver's "
                    "profiling cannot be trusted",
                    launch->count(), wall.count()));
  }
}

/// How the phases of one kernel are sampled, decided after the warm-up.
struct Plan {
  std::int64_t call = 1;    ///< Calls a batch.
  std::int64_t upload = 0;  ///< Own batch; 0 = timed within the call.
  std::int64_t execute = 0;
  std::int64_t download = 0;
};

class Sampler {
 public:
  Sampler(Kernel& kernel, const Clock& clock, const ClockQuality& quality,
          std::span<const Phase> phases, const Sequence& sequence)
      : kernel_(kernel), clock_(clock), quality_(quality), sequence_(sequence) {
    has_upload_ = std::ranges::find(phases, Phase::kUpload) != phases.end();
    has_download_ = std::ranges::find(phases, Phase::kDownload) != phases.end();
  }

  void warm_up(Nanos time) {
    const bool simulated = quality_.cost_ns == 0;
    std::vector<CallTimes> latest;
    const Nanos start = clock_.now();
    for (std::size_t calls = 0;
         calls < kFewestWarmUpCalls ||
         (clock_.now() - start < time && !(simulated && calls == kMostSimulatedWarmUpCalls));
         ++calls) {
      if (latest.size() == kEstimateCalls) latest.erase(latest.begin());
      latest.push_back(timed_call());
      if (sequence_.next) sequence_.next();
    }
    const auto estimate = [&latest](Nanos CallTimes::*member) {
      std::vector<Nanos> times;
      for (const CallTimes& call : latest) times.push_back(call.*member);
      return median(times);
    };
    plan_.call = batch(estimate(&CallTimes::call));
    plan_.upload = own_batch(estimate(&CallTimes::upload));
    plan_.execute = own_batch(estimate(&CallTimes::execute));
    plan_.download = own_batch(estimate(&CallTimes::download));
  }

  void sample() {
    if (plan_.call == 1) {
      keep(timed_call());
    } else {
      sample_call_batch();
    }
    if (has_upload_ && plan_.upload != 0) {
      uploads_.push_back(timed(plan_.upload, [this] { kernel_.upload(); }));
    }
    if (!execute_is_call() && plan_.execute != 0) sample_execute_batch();
    if (has_download_ && plan_.download != 0) {
      downloads_.push_back(timed(plan_.download, [this] { kernel_.download(); }));
    }
    if (sequence_.next) sequence_.next();
  }

  [[nodiscard]] const std::vector<Nanos>& calls() const { return calls_; }

  [[nodiscard]] PhaseSamples samples_of(Phase phase) const {
    const auto size = [this](std::int64_t own) { return own != 0 ? own : plan_.call; };
    switch (phase) {
      case Phase::kUpload:
        return {phase, uploads_, size(plan_.upload)};
      case Phase::kLaunch:
        return {phase, launches_, execute_batch()};
      case Phase::kExecute:
        return {phase, executes_, execute_batch()};
      case Phase::kDownload:
        return {phase, downloads_, size(plan_.download)};
      case Phase::kCall:
        return {phase, calls_, plan_.call};
      case Phase::kDeviceInit:
      case Phase::kPrepare:
        break;
    }
    return {phase, {}, 1};
  }

 private:
  /// Without transfers a call is its execution: one timing serves both.
  [[nodiscard]] bool execute_is_call() const { return !has_upload_ && !has_download_; }

  [[nodiscard]] std::int64_t execute_batch() const {
    return plan_.execute != 0 && !execute_is_call() ? plan_.execute : plan_.call;
  }

  [[nodiscard]] std::int64_t batch(Nanos estimate) const {
    return quality_.cost_ns > 0 ? batch_size(estimate) : 1;
  }

  /// Phases that are long against the clock are timed within single calls, where they belong
  /// together; the others on their own.
  [[nodiscard]] std::int64_t own_batch(Nanos estimate) const {
    const bool clock_shows = quality_.cost_ns > kClockShare * static_cast<double>(estimate.count());
    return plan_.call == 1 && !clock_shows ? 0 : batch(estimate);
  }

  CallTimes timed_call() {
    CallTimes times;
    const Nanos start = clock_.now();
    kernel_.upload();
    const Nanos uploaded = clock_.now();
    times.launch = kernel_.execute(1);
    const Nanos executed = clock_.now();
    kernel_.download();
    const Nanos end = clock_.now();
    check_launch(times.launch, executed - uploaded);
    times.upload = uploaded - start;
    times.execute = executed - uploaded - times.launch.value_or(Nanos(0));
    times.download = end - executed;
    times.call = end - start;
    return times;
  }

  void keep(const CallTimes& times) {
    calls_.push_back(times.call);
    if (has_upload_ && plan_.upload == 0) uploads_.push_back(times.upload);
    if (has_download_ && plan_.download == 0) downloads_.push_back(times.download);
    if (plan_.execute == 0 || execute_is_call()) {
      executes_.push_back(times.execute);
      if (times.launch) launches_.push_back(*times.launch);
    }
  }

  template <typename Step>
  Nanos timed(std::int64_t repeats, Step step) {
    const Nanos start = clock_.now();
    for (std::int64_t i = 0; i < repeats; ++i) step();
    return (clock_.now() - start) / repeats;
  }

  void execute_once(std::optional<Nanos>& launches) {
    if (const auto launch = kernel_.execute(1)) launches = launches.value_or(Nanos(0)) + *launch;
  }

  void keep_execute(Nanos wall, std::optional<Nanos> launches, std::int64_t repeats) {
    if (launches) *launches /= repeats;
    check_launch(launches, wall);
    executes_.push_back(wall - launches.value_or(Nanos(0)));
    if (launches) launches_.push_back(*launches);
  }

  void sample_call_batch() {
    std::optional<Nanos> launches;
    const Nanos call = timed(plan_.call, [&] {
      kernel_.upload();
      execute_once(launches);
      kernel_.download();
    });
    calls_.push_back(call);
    if (execute_is_call()) keep_execute(call, launches, plan_.call);
  }

  void sample_execute_batch() {
    std::optional<Nanos> launches;
    const Nanos wall = timed(plan_.execute, [&] { execute_once(launches); });
    keep_execute(wall, launches, plan_.execute);
  }

  Kernel& kernel_;
  const Clock& clock_;
  ClockQuality quality_;
  const Sequence& sequence_;
  bool has_upload_ = false;
  bool has_download_ = false;
  Plan plan_;
  std::vector<Nanos> uploads_, launches_, executes_, downloads_, calls_;
};

void sample_for(Sampler& sampler, const Clock& clock, const SamplingOptions& options,
                std::int64_t frames) {
  const Nanos start = clock.now();
  while (true) {
    sampler.sample();
    const auto samples = static_cast<std::int64_t>(sampler.calls().size());
    const Nanos spent = clock.now() - start;
    if (spent >= options.limit || samples >= options.max_samples) return;
    const bool whole = samples % frames == 0;
    if (whole && spent >= options.slice && samples >= options.min_samples) return;
  }
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
  // The smallest step seen is bounded by the cost itself on a fine clock; that is the finest that
  // can be told apart.
  return {static_cast<double>(median(rounds).count()) / (kReadings - 1), smallest};
}

std::vector<PhaseSamples> sample_calls(Kernel& kernel, const Clock& clock,
                                       const ClockQuality& quality, std::span<const Phase> phases,
                                       const SamplingOptions& options, const Sequence& sequence) {
  Sampler sampler(kernel, clock, quality, phases, sequence);
  sampler.warm_up(options.warm_up);
  sample_for(sampler, clock, options, sequence.frames);
  const bool simulated = quality.cost_ns == 0;
  std::vector<PhaseSamples> result;
  for (const Phase phase : phases) {
    PhaseSamples samples = sampler.samples_of(phase);
    const auto is_zero = [](Nanos t) { return t.count() == 0; };
    const bool absent =
        samples.samples.empty() || (simulated && std::ranges::all_of(samples.samples, is_zero));
    if (!absent) result.push_back(std::move(samples));
  }
  return result;
}

std::int64_t batch_size(Nanos one_call) {
  if (one_call >= kBatchTime) return 1;
  const std::int64_t call_ns = std::max<std::int64_t>(1, one_call.count());
  return std::min(kLargestBatch, (kBatchTime.count() + call_ns - 1) / call_ns);
}

double clock_share(Nanos median_sample, std::int64_t batch, const ClockQuality& quality) {
  if (quality.cost_ns <= 0) return 0;
  const double timed_ns = static_cast<double>(median_sample.count()) * static_cast<double>(batch);
  const double doubt_ns =
      std::max(quality.cost_ns, static_cast<double>(quality.resolution.count()));
  return doubt_ns / std::max(timed_ns, 1.0);
}

bool is_clock_bound(Nanos median_sample, std::int64_t batch, const ClockQuality& quality) {
  return clock_share(median_sample, batch, quality) > kClockBoundShare;
}

}  // namespace pirt
