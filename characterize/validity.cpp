#include "characterize/validity.h"

#include <algorithm>

#include "characterize/statistics.h"

namespace pirt {
namespace {
constexpr double kUnstableShare = 0.20;
}

bool is_unstable(std::span<const Nanos> samples) {
  const auto first = samples.first(samples.size() / 2);
  const auto second = samples.subspan(samples.size() / 2);
  const auto a = median_interval(first);
  const auto b = median_interval(second);
  if (!a || !b) return false;
  const bool apart = a->high < b->low || b->high < a->low;
  const double low = static_cast<double>(std::min(median(first), median(second)).count());
  const double high = static_cast<double>(std::max(median(first), median(second)).count());
  return apart && high - low > kUnstableShare * low;
}

std::vector<std::string> judge(const PhaseSamples& samples, const JobResult& result,
                               const SamplingOptions& options, bool unstable) {
  std::vector<std::string> reasons;
  if (result.wrong_output) reasons.emplace_back("wrong_output");
  if (static_cast<std::int64_t>(samples.samples.size()) < options.min_samples) {
    reasons.emplace_back("few_samples");
  }
  if (samples.phase != Phase::kLaunch && !samples.samples.empty() &&
      is_clock_bound(median(samples.samples), samples.batch, result.clock)) {
    reasons.emplace_back("clock_bound");
  }
  if (result.throttled) reasons.emplace_back("throttled");
  if (unstable) reasons.emplace_back("unstable");
  return reasons;
}

std::vector<std::string> annotate(const PhaseSamples& samples, const JobResult& result,
                                  const SamplingOptions& options) {
  std::vector<std::string> notes;
  const auto reached = relative_precision(samples.samples);
  if (!reached || *reached > options.precision) notes.emplace_back("precision_not_reached");
  if (result.contended) notes.emplace_back("contended");
  if (is_bimodal(samples.samples)) notes.emplace_back("bimodal");
  return notes;
}

}  // namespace pirt
