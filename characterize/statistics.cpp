#include "characterize/statistics.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>

namespace pirt {
namespace {

constexpr std::size_t kMinimumForBimodal = 20;
constexpr double kSmallerGroup = 0.15;
constexpr double kGroupDistance = 0.05;

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

/// Ashman's D of the two-means split, or nothing if the split leaves too small a group or too small
/// a distance.
std::optional<double> separation(std::span<const Nanos> sorted) {
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
  if (std::min(low.size, high.size) < kSmallerGroup * total) return std::nullopt;
  if (high.mean - low.mean < kGroupDistance * middle) return std::nullopt;
  const double spread = std::sqrt(low.squares / low.size + high.squares / high.size);
  if (spread == 0) return std::numeric_limits<double>::infinity();
  return std::numbers::sqrt2 * (high.mean - low.mean) / spread;
}

bool bimodal_of_sorted(std::span<const Nanos> sorted) {
  if (sorted.size() < kMinimumForBimodal) return false;
  const auto d = separation(sorted);
  return d && *d > kBimodalD;
}

}  // namespace

std::optional<Ranks> median_interval_ranks(std::size_t n) {
  // P(B <= k) summed term by term in logarithms, so that 2^-n does not underflow for thousands of
  // samples.
  constexpr double kTail = 0.025;
  const auto size = static_cast<double>(n);
  double log_term = -size * std::numbers::ln2;  // log of C(n, 0) / 2^n
  double tail = 0;                              // P(B < low)
  std::size_t low = 0;
  while (low < n / 2) {
    const double next = tail + std::exp(log_term);
    if (next > kTail) break;
    tail = next;
    const auto k = static_cast<double>(low);
    log_term += std::log((size - k) / (k + 1));
    ++low;
  }
  if (low == 0) return std::nullopt;
  return Ranks{low, n - low + 1};
}

Nanos median(std::span<const Nanos> samples) { return median_of_sorted(sorted_copy(samples)); }

Nanos percentile(std::span<const Nanos> samples, int percent) {
  return percentile_of_sorted(sorted_copy(samples), percent);
}

std::optional<Interval> median_interval(std::span<const Nanos> samples) {
  return interval_of_sorted(sorted_copy(samples));
}

std::optional<double> relative_precision(std::span<const Nanos> samples) {
  if (samples.empty()) return std::nullopt;
  const auto sorted = sorted_copy(samples);
  const auto interval = interval_of_sorted(sorted);
  const Nanos middle = median_of_sorted(sorted);
  if (!interval || middle.count() == 0) return std::nullopt;
  return 0.5 * static_cast<double>((interval->high - interval->low).count()) /
         static_cast<double>(middle.count());
}

bool is_bimodal(std::span<const Nanos> samples) { return bimodal_of_sorted(sorted_copy(samples)); }

Statistics summarize(std::span<const Nanos> samples) {
  const auto sorted = sorted_copy(samples);
  Statistics result;
  result.samples = static_cast<std::int64_t>(sorted.size());
  result.median = median_of_sorted(sorted);
  std::vector<Nanos> deviations;
  deviations.reserve(sorted.size());
  for (const Nanos t : sorted) {
    deviations.push_back(t > result.median ? t - result.median : result.median - t);
  }
  result.mad = median(deviations);
  result.p95 = percentile_of_sorted(sorted, 95);
  result.p99 = percentile_of_sorted(sorted, 99);
  result.interval = interval_of_sorted(sorted);
  result.bimodal = bimodal_of_sorted(sorted);
  return result;
}

}  // namespace pirt
