#include "characterize/campaign/validity.h"

#include <algorithm>
#include <map>
#include <utility>

#include "characterize/profile/profile.h"

namespace pirt {
namespace {

constexpr double kUnstableShare = 0.20;
constexpr double kImprecise = 0.20;
constexpr double kPartOfCall = 0.05;
constexpr Nanos kSetupGrain = std::chrono::milliseconds(1);
constexpr std::size_t kFewestHalves = 4;  // processes; two in each half

bool far_apart(Nanos a, Nanos b) {
  const double low = static_cast<double>(std::min(a, b).count());
  const double high = static_cast<double>(std::max(a, b).count());
  return high - low > kUnstableShare * low;
}

Nanos half_of(const Interval& interval) { return (interval.high - interval.low) / 2; }

/// Of processes in order of time; absent where the earlier and the later ones overlap.
std::optional<std::pair<Nanos, Nanos>> halves_apart(std::span<const Nanos> medians) {
  if (medians.size() < kFewestHalves) return std::nullopt;
  const auto first = medians.first(medians.size() / 2);
  const auto second = medians.subspan(medians.size() / 2);
  const auto [first_low, first_high] = std::ranges::minmax(first);
  const auto [second_low, second_high] = std::ranges::minmax(second);
  if (first_high >= second_low && second_high >= first_low) return std::nullopt;
  return std::pair(median(first), median(second));
}

std::size_t unstable_processes(std::span<const Nanos> samples,
                               std::span<const std::int32_t> processes) {
  std::map<std::int32_t, std::vector<Nanos>> of;
  for (std::size_t i = 0; i < samples.size(); ++i) of[processes[i]].push_back(samples[i]);
  return static_cast<std::size_t>(
      std::ranges::count_if(of, [](const auto& entry) { return is_unstable(entry.second); }));
}

}  // namespace

bool is_unstable(std::span<const Nanos> samples) {
  const auto first = samples.first(samples.size() / 2);
  const auto second = samples.subspan(samples.size() / 2);
  const auto a = median_interval(first);
  const auto b = median_interval(second);
  if (!a || !b) return false;
  const bool apart = a->high < b->low || b->high < a->low;
  return apart && far_apart(median(first), median(second));
}

bool is_unstable(std::span<const Nanos> samples, std::span<const std::int32_t> processes) {
  const std::vector<Nanos> medians = process_medians(samples, processes);
  if (2 * unstable_processes(samples, processes) > medians.size()) return true;
  const auto halves = halves_apart(medians);
  return halves && far_apart(halves->first, halves->second);
}

bool concerns_row(std::int64_t affected, std::int64_t processes) {
  return affected > 0 && 4 * affected >= processes;
}

bool is_spoilt_by_others(const CellConditions& conditions) {
  return conditions.contended && (conditions.crowded || !conditions.precise);
}

bool is_imprecise(const std::optional<Interval>& interval, Nanos median,
                  const std::optional<Nanos>& call) {
  if (!interval) return false;
  const auto share_of = [half = half_of(*interval)](Nanos whole, double limit) {
    return static_cast<double>(half.count()) > limit * static_cast<double>(whole.count());
  };
  return share_of(median, kImprecise) && (!call || share_of(*call, kPartOfCall));
}

Judgement judge_setups(std::span<const Nanos> times, const CellConditions& conditions) {
  Judgement found;
  if (times.empty()) return found;
  if (conditions.throttled) found.add("throttled");
  const auto halves = halves_apart(times);
  if (halves && far_apart(halves->first, halves->second) &&
      std::chrono::abs(halves->first - halves->second) > kSetupGrain) {
    found.add("unstable");
  }
  auto interval = interval_over_processes(times);
  if (times.size() == 2) interval = {std::min(times[0], times[1]), std::max(times[0], times[1])};
  if (is_imprecise(interval, median(times), std::nullopt) && half_of(*interval) > kSetupGrain) {
    found.add("imprecise");
  }
  if (conditions.crowded) found.add("contended");
  return found;
}

Judgement judge(const CellSamples& samples, const CellConditions& conditions) {
  Judgement found;
  const auto medians = process_medians(samples.samples, samples.processes);
  if (conditions.wrong_output) {
    found.add("wrong_output");  // which ended the sampling
  } else if (conditions.deterministic) {
    return found;
  } else if (static_cast<std::int64_t>(samples.samples.size()) < kFewestSamples ||
             (!conditions.live && static_cast<std::int64_t>(medians.size()) < kFewestProcesses)) {
    found.add(samples.samples.empty() ? "no_samples" : "few_samples");
  }
  if (samples.phase != Phase::kLaunch && !medians.empty() &&
      is_clock_bound(median(medians), samples.batch, conditions.clock)) {
    found.add("clock_bound");
  }
  if (conditions.throttled) found.add("throttled");
  if (conditions.unstable) found.add("unstable");
  if (!samples.samples.empty()) {
    const auto summary = summarize(samples.samples, samples.processes);
    const bool whole = samples.phase == Phase::kCall;
    if (is_imprecise(summary.interval, summary.median, whole ? std::nullopt : conditions.call)) {
      found.add("imprecise");
    }
  }
  if (is_spoilt_by_others(conditions)) found.add("contended");
  if (samples.has_many_odd_stamps()) found.add("odd_stamps");
  return found;
}

std::vector<std::string> annotate(const CellSamples& samples, const CellConditions& conditions,
                                  double precision) {
  std::vector<std::string> notes;
  if (samples.samples.empty()) return notes;
  if (conditions.deterministic) return {std::string(kDeterministic)};
  const auto summary = summarize(samples.samples, samples.processes);
  const auto reached = relative_half_width(summary.interval, summary.median);
  if (!reached || *reached > precision) notes.emplace_back("precision_not_reached");
  if (conditions.contended && !is_spoilt_by_others(conditions)) notes.emplace_back("contended");
  if (summary.bimodal) notes.emplace_back("bimodal");
  if (conditions.live) notes.emplace_back("live");
  if (samples.odd_stamps > 0 && !samples.has_many_odd_stamps()) notes.emplace_back("odd_stamps");
  return notes;
}

}  // namespace pirt
