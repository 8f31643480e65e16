#include "characterize/campaign/validity.h"

#include <algorithm>
#include <map>

#include "characterize/profile/profile.h"
#include "characterize/statistics/statistics.h"

namespace pirt {
namespace {

constexpr double kUnstableShare = 0.20;
constexpr std::size_t kFewestHalves = 4;  // processes; two in each half

bool far_apart(Nanos a, Nanos b) {
  const double low = static_cast<double>(std::min(a, b).count());
  const double high = static_cast<double>(std::max(a, b).count());
  return high - low > kUnstableShare * low;
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
  if (medians.size() < kFewestHalves) return false;
  const auto first = std::span(medians).first(medians.size() / 2);
  const auto second = std::span(medians).subspan(medians.size() / 2);
  const auto [first_low, first_high] = std::ranges::minmax(first);
  const auto [second_low, second_high] = std::ranges::minmax(second);
  const bool apart = first_high < second_low || second_high < first_low;
  return apart && far_apart(median(first), median(second));
}

bool concerns_row(std::int64_t affected, std::int64_t processes) {
  return affected > 0 && 4 * affected >= processes;
}

std::vector<std::string> judge(const CellSamples& samples, const CellConditions& conditions) {
  std::vector<std::string> reasons;
  const auto medians = process_medians(samples.samples, samples.processes);
  if (conditions.wrong_output) {
    reasons.emplace_back("wrong_output");  // which ended the sampling
  } else if (conditions.deterministic) {
    return reasons;
  } else if (static_cast<std::int64_t>(samples.samples.size()) < kFewestSamples ||
             (!conditions.live && static_cast<std::int64_t>(medians.size()) < kFewestProcesses)) {
    reasons.emplace_back("few_samples");
  }
  if (samples.phase != Phase::kLaunch && !medians.empty() &&
      is_clock_bound(median(medians), samples.batch, conditions.clock)) {
    reasons.emplace_back("clock_bound");
  }
  if (conditions.throttled) reasons.emplace_back("throttled");
  if (conditions.unstable) reasons.emplace_back("unstable");
  return reasons;
}

std::vector<std::string> annotate(const CellSamples& samples, const CellConditions& conditions,
                                  double precision) {
  std::vector<std::string> notes;
  if (samples.samples.empty()) return notes;
  if (conditions.deterministic) return {std::string(kDeterministic)};
  const auto summary = summarize(samples.samples, samples.processes);
  const auto reached = relative_half_width(summary.interval, summary.median);
  if (!reached || *reached > precision) notes.emplace_back("precision_not_reached");
  if (conditions.contended) notes.emplace_back("contended");
  if (summary.bimodal) notes.emplace_back("bimodal");
  if (conditions.live) notes.emplace_back("live");
  return notes;
}

}  // namespace pirt
