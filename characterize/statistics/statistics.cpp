#include "characterize/statistics/statistics.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

namespace pirt {
namespace {

constexpr double kTail = 0.025;  // on either side of a 95 % interval
/// Of an interval over processes, which ends a cell as soon as it is narrow enough: at 95 % those
/// that ended there would hold the median in 92 % only.
constexpr double kConfidence = 0.97;
constexpr std::size_t kFewestProcesses = 3;  // for Student's t
constexpr std::size_t kFewestForRanks = 6;   // with 5, the smallest to the largest covers 93.75 %
constexpr std::size_t kFewestForDependence = 8;
constexpr double kMostDependence = 0.6;

std::vector<Nanos> sorted_copy(std::span<const Nanos> samples) {
  std::vector<Nanos> sorted(samples.begin(), samples.end());
  std::ranges::sort(sorted);
  return sorted;
}

Nanos median_of_sorted(std::span<const Nanos> sorted) {
  assert(!sorted.empty());
  const std::size_t upper = sorted.size() / 2;
  if (sorted.size() % 2 == 1) return sorted[upper];
  return sorted[upper - 1] + (sorted[upper] - sorted[upper - 1]) / 2;
}

Nanos percentile_of_sorted(std::span<const Nanos> sorted, int percent) {
  assert(!sorted.empty() && percent >= 1 && percent <= 100);
  const std::size_t rank = (sorted.size() * static_cast<std::size_t>(percent) + 99) / 100;
  return sorted[rank - 1];
}

std::optional<Interval> interval_of_sorted(std::span<const Nanos> sorted) {
  const auto ranks = median_interval_ranks(sorted.size());
  if (!ranks) return std::nullopt;
  return Interval{sorted[ranks->low - 1], sorted[ranks->high - 1]};
}

/// Mean and sum of squared deviations of sorted[begin, end), from prefix sums relative to the first
/// sample.
struct Group {
  double mean = 0;
  double squares = 0;
  double size = 0;
};

Group group_of(double sum, double sum_of_squares, std::size_t size) {
  const auto n = static_cast<double>(size);
  const double mean = sum / n;
  return {mean, std::max(0.0, sum_of_squares - n * mean * mean), n};
}

/// What counts as two groups: of how many, at least how much of them in the smaller one, and how
/// far apart relative to the median.
struct GroupLimits {
  std::size_t fewest;
  double smaller;
  double distance;
};
constexpr GroupLimits kOfSamples = {20, 0.15, 0.05};
constexpr GroupLimits kOfProcesses = {4, 0.15, 0.20};
constexpr double kFewestInGroup = 2;

/// Ashman's D of the two-means split, or nothing if the split leaves too small a group or too small
/// a distance.
std::optional<double> separation(std::span<const Nanos> sorted, const GroupLimits& limits) {
  const double origin = static_cast<double>(sorted.front().count());
  double sum = 0;
  double squares = 0;
  for (const Nanos t : sorted) {
    const double x = static_cast<double>(t.count()) - origin;
    sum += x;
    squares += x * x;
  }
  double best = std::numeric_limits<double>::infinity();
  Group low, high;
  double left_sum = 0;
  double left_squares = 0;
  for (std::size_t i = 0; i + 1 < sorted.size(); ++i) {
    const double x = static_cast<double>(sorted[i].count()) - origin;
    left_sum += x;
    left_squares += x * x;
    const Group left = group_of(left_sum, left_squares, i + 1);
    const Group right = group_of(sum - left_sum, squares - left_squares, sorted.size() - i - 1);
    if (left.squares + right.squares < best) {
      best = left.squares + right.squares;
      low = left;
      high = right;
    }
  }
  const auto total = static_cast<double>(sorted.size());
  const auto middle = static_cast<double>(median_of_sorted(sorted).count());
  const double smaller = std::min(low.size, high.size);
  if (smaller < std::max(kFewestInGroup, limits.smaller * total)) return std::nullopt;
  if (high.mean - low.mean < limits.distance * middle) return std::nullopt;
  const double spread = std::sqrt(low.squares / low.size + high.squares / high.size);
  if (spread == 0) return std::numeric_limits<double>::infinity();
  return std::numbers::sqrt2 * (high.mean - low.mean) / spread;
}

/// The highest rank k such that at most @p tail of all sets of n have their median below the kth
/// smallest; 0 if there is none.
std::size_t outer_rank(std::size_t n, double tail) {
  // P(B <= k) summed term by term in logarithms, so that 2^-n does not underflow for thousands of
  // samples.
  const auto size = static_cast<double>(n);
  double log_term = -size * std::numbers::ln2;  // log of C(n, 0) / 2^n
  double below = 0;                             // P(B < rank)
  std::size_t rank = 0;
  while (rank < n / 2) {
    below += std::exp(log_term);
    if (below > tail) break;
    const auto k = static_cast<double>(rank);
    log_term += std::log((size - k) / (k + 1));
    ++rank;
  }
  return rank;
}

/// P(low-th smallest <= median <= low-th largest) of n samples: 1 - 2 P(Binomial(n, 1/2) < low).
double coverage(std::size_t n, std::size_t low) {
  double tail = 0;
  double ways = 1;  // C(n, k) / 2^scale: of a thousand samples, no double holds C(n, k)
  int scale = 0;
  for (std::size_t k = 0; k < low; ++k) {
    tail += std::ldexp(ways, scale - static_cast<int>(n));
    ways *= static_cast<double>(n - k) / static_cast<double>(k + 1);
    constexpr int kStep = 512;
    if (ways > 0x1p512) ways = std::ldexp(ways, -kStep), scale += kStep;
  }
  return 1 - 2 * tail;
}

Nanos between(Nanos from, Nanos to, double share) { return from + scaled(to - from, share); }

/// Between the last pair of order statistics that covers kConfidence and the next inner one; the
/// smallest to the largest where these do not.
Interval interpolated_interval(std::span<const Nanos> sorted) {
  const std::size_t n = sorted.size();
  const std::size_t low = outer_rank(n, 0.5 * (1 - kConfidence));
  if (low == 0) return {sorted.front(), sorted.back()};
  const double outer = coverage(n, low);
  const double inner = coverage(n, low + 1);
  const double excess = (outer - kConfidence) / (outer - inner);
  const double outside = static_cast<double>(n - low);
  const double inward =
      outside * excess / (static_cast<double>(low) + (outside - static_cast<double>(low)) * excess);
  return {between(sorted[low - 1], sorted[low], inward),
          between(sorted[n - low], sorted[n - low - 1], inward)};
}

/// Student's t around the mean, reaching at least to the median and not below the smallest.
Interval t_interval(std::span<const Nanos> sorted) {
  constexpr std::array kQuantile = {4.303, 3.182, 2.776};  // t(0.975) for 2, 3 and 4 degrees
  const std::size_t n = sorted.size();
  const double origin = static_cast<double>(sorted.front().count());
  double sum = 0;
  double squares = 0;
  for (const Nanos t : sorted) {
    const double x = static_cast<double>(t.count()) - origin;
    sum += x;
    squares += x * x;
  }
  const Group all = group_of(sum, squares, n);
  const double half =
      kQuantile[n - kFewestProcesses] * std::sqrt(all.squares / (all.size - 1) / all.size);
  const Nanos middle = median_of_sorted(sorted);
  const auto at = [&](double x) { return sorted.front() + Nanos(std::llround(x)); };
  return {std::clamp(at(all.mean - half), sorted.front(), middle),
          std::max(at(all.mean + half), middle)};
}

/// Ranks in order of the values, equal ones sharing the mean of theirs.
std::vector<double> ranks_of(std::span<const Nanos> values) {
  std::vector<double> ranks;
  ranks.reserve(values.size());
  const auto sorted = sorted_copy(values);
  for (const Nanos value : values) {
    const auto [first, last] = std::equal_range(sorted.begin(), sorted.end(), value);
    ranks.push_back(0.5 * static_cast<double>((first - sorted.begin()) + (last - sorted.begin())));
  }
  return ranks;
}

/// Lag 1, around the mean; absent for values that are all equal.
std::optional<double> autocorrelation(std::span<const double> values) {
  double mean = 0;
  for (const double value : values) mean += value / static_cast<double>(values.size());
  double products = 0;
  double squares = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    squares += (values[i] - mean) * (values[i] - mean);
    if (i > 0) products += (values[i] - mean) * (values[i - 1] - mean);
  }
  return squares > 0 ? std::optional(products / squares) : std::nullopt;
}

/// @param middle  Within @p interval.
/// @param least   Where it begins at the lowest.
Interval widened(const Interval& interval, Nanos middle, double factor, Nanos least) {
  return {std::max(least, middle - scaled(middle - interval.low, factor)),
          middle + scaled(interval.high - middle, factor)};
}

bool bimodal_of_sorted(std::span<const Nanos> sorted, const GroupLimits& limits) {
  if (sorted.size() < limits.fewest) return false;
  const auto d = separation(sorted, limits);
  return d && *d > kBimodalD;
}

}  // namespace

std::optional<Ranks> median_interval_ranks(std::size_t n) {
  const std::size_t low = outer_rank(n, kTail);
  if (low == 0) return std::nullopt;
  return Ranks{low, n - low + 1};
}

Nanos median(std::span<const Nanos> samples) { return median_of_sorted(sorted_copy(samples)); }

Nanos median(std::span<const Nanos> samples, std::span<const std::int32_t> processes) {
  return processes.empty() ? median(samples) : median(process_medians(samples, processes));
}

Nanos mean(std::span<const Nanos> samples, std::span<const std::int32_t> processes) {
  struct Sum {
    double ns = 0;
    double count = 0;
  };
  std::map<std::int32_t, Sum> sums;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    Sum& sum = sums[processes.empty() ? 0 : processes[i]];
    sum.ns += static_cast<double>(samples[i].count());
    ++sum.count;
  }
  assert(!sums.empty());
  double of_means = 0;
  for (const auto& [process, sum] : sums) of_means += sum.ns / sum.count;
  return Nanos(std::llround(of_means / static_cast<double>(sums.size())));
}

Nanos percentile(std::span<const Nanos> samples, int percent) {
  return percentile_of_sorted(sorted_copy(samples), percent);
}

std::optional<Interval> median_interval(std::span<const Nanos> samples) {
  return interval_of_sorted(sorted_copy(samples));
}

std::optional<double> relative_half_width(const std::optional<Interval>& interval, Nanos middle) {
  if (!interval || middle.count() == 0) return std::nullopt;
  return 0.5 * static_cast<double>((interval->high - interval->low).count()) /
         static_cast<double>(middle.count());
}

std::vector<Nanos> process_medians(std::span<const Nanos> samples,
                                   std::span<const std::int32_t> processes) {
  assert(samples.size() == processes.size());
  std::map<int, std::vector<Nanos>> of;
  for (std::size_t i = 0; i < samples.size(); ++i) of[processes[i]].push_back(samples[i]);
  std::vector<Nanos> medians;
  medians.reserve(of.size());
  for (const auto& [process, taken] : of) medians.push_back(median(taken));
  return medians;
}

std::optional<Interval> interval_over_processes(std::span<const Nanos> medians) {
  const auto sorted = sorted_copy(medians);
  if (sorted.size() < kFewestProcesses) return std::nullopt;
  if (sorted.size() < kFewestForRanks) return t_interval(sorted);
  return widened(interpolated_interval(sorted), median_of_sorted(sorted),
                 dependence_factor(medians), sorted.front());
}

double dependence_factor(std::span<const Nanos> values) {
  if (values.size() < kFewestForDependence) return 1;
  const auto n = static_cast<double>(values.size());
  const auto found = autocorrelation(ranks_of(values));
  if (!found) return 1;
  const double r = std::clamp((n * *found + 1) / (n - 4), 0.0, kMostDependence);
  return std::sqrt((1 + r) / (1 - r));
}

bool is_bimodal(std::span<const Nanos> samples) {
  return bimodal_of_sorted(sorted_copy(samples), kOfSamples);
}

bool processes_are_bimodal(std::span<const Nanos> medians) {
  return bimodal_of_sorted(sorted_copy(medians), kOfProcesses);
}

namespace {

/// What does not depend on which process took a sample.
Statistics describe(std::span<const Nanos> sorted, Nanos middle) {
  Statistics result;
  result.samples = static_cast<std::int64_t>(sorted.size());
  result.median = middle;
  std::vector<Nanos> deviations;
  deviations.reserve(sorted.size());
  for (const Nanos t : sorted) deviations.push_back(t > middle ? t - middle : middle - t);
  result.mad = median(deviations);
  result.p95 = percentile_of_sorted(sorted, 95);
  result.p99 = percentile_of_sorted(sorted, 99);
  result.bimodal = bimodal_of_sorted(sorted, kOfSamples);
  return result;
}

}  // namespace

Statistics summarize(std::span<const Nanos> samples) {
  const auto sorted = sorted_copy(samples);
  Statistics result = describe(sorted, median_of_sorted(sorted));
  result.interval = interval_of_sorted(sorted);
  return result;
}

Statistics summarize(std::span<const Nanos> samples, std::span<const std::int32_t> processes) {
  const auto medians = process_medians(samples, processes);
  Statistics result = describe(sorted_copy(samples), median(medians));
  result.interval =
      medians.size() == 1 ? median_interval(samples) : interval_over_processes(medians);
  result.processes = static_cast<std::int64_t>(medians.size());
  result.bimodal = result.bimodal || processes_are_bimodal(medians);
  return result;
}

}  // namespace pirt
