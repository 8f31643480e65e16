#include "characterize/statistics/rank_tests.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

namespace pirt {
namespace {

constexpr std::size_t kExactPairs = 400;

/// Pairs in which the candidate is larger; half a pair for equals.
struct Ranked {
  double u = 0;
  double ties = 0;  ///< Sum of t^3 - t over groups of t equal samples.
};

Ranked rank(std::span<const Nanos> base, std::span<const Nanos> candidate) {
  struct Sample {
    Nanos value;
    bool of_candidate;
  };
  std::vector<Sample> all;
  for (const Nanos each : base) all.push_back({each, false});
  for (const Nanos each : candidate) all.push_back({each, true});
  std::ranges::sort(all, {}, &Sample::value);
  Ranked result;
  double base_below = 0;
  for (std::size_t begin = 0; begin < all.size();) {
    std::size_t end = begin;
    double of_base = 0;
    double of_candidate = 0;
    for (; end < all.size() && all[end].value == all[begin].value; ++end) {
      (all[end].of_candidate ? of_candidate : of_base) += 1;
    }
    result.u += of_candidate * (base_below + of_base / 2);
    const auto equal = static_cast<double>(end - begin);
    result.ties += equal * equal * equal - equal;
    base_below += of_base;
    begin = end;
  }
  return result;
}

/// P(U >= u) where all orders of m and n samples are equally likely: counts[i][k] is in how many
/// orders i of the samples placed so far are the candidate's and k pairs are theirs.
double exact_p(std::size_t m, std::size_t n, double u) {
  const std::size_t pairs = m * n;
  std::vector<std::vector<double>> counts(n + 1, std::vector<double>(pairs + 1, 0));
  counts[0][0] = 1;
  // The samples are placed from the smallest on.
  for (std::size_t placed = 1; placed <= m + n; ++placed) {
    for (std::size_t i = std::min(placed, n);; --i) {
      const std::size_t of_base = placed - i;  // If the sample is the base's, of_base counts it.
      std::vector<double> next(pairs + 1, 0);
      if (of_base <= m) {
        if (placed > i) {  // The base's: i candidates are below it, no new pair.
          for (std::size_t k = 0; k <= pairs; ++k) next[k] += counts[i][k];
        }
        if (i > 0) {  // The candidate's: above all of_base samples of the base so far.
          for (std::size_t k = of_base; k <= pairs; ++k) next[k] += counts[i - 1][k - of_base];
        }
      }
      counts[i] = std::move(next);
      if (i == 0) break;
    }
  }
  double above = 0;
  double all = 0;
  for (std::size_t k = 0; k <= pairs; ++k) {
    all += counts[n][k];
    if (static_cast<double>(k) >= u) above += counts[n][k];
  }
  return above / all;
}

double upper_tail(double z) { return 0.5 * std::erfc(z / std::sqrt(2.0)); }

/// P(Binomial(n, 1/2) >= k).
double binomial_tail(std::size_t n, std::size_t k) {
  double sum = 0;
  const auto count = static_cast<double>(n);
  for (std::size_t i = k; i <= n; ++i) {
    const auto each = static_cast<double>(i);
    sum += std::exp(std::lgamma(count + 1) - std::lgamma(each + 1) - std::lgamma(count - each + 1) -
                    count * std::log(2.0));
  }
  return std::min(1.0, sum);
}

}  // namespace

double mann_whitney_p(std::span<const Nanos> base, std::span<const Nanos> candidate) {
  if (base.empty() || candidate.empty()) return 1;
  const Ranked ranked = rank(base, candidate);
  if (base.size() * candidate.size() <= kExactPairs && ranked.ties == 0) {
    return exact_p(base.size(), candidate.size(), ranked.u);
  }
  const auto m = static_cast<double>(base.size());
  const auto n = static_cast<double>(candidate.size());
  const double all = m + n;
  const double variance = m * n / 12 * (all + 1 - ranked.ties / (all * (all - 1)));
  if (variance <= 0) return 1;  // All samples are equal.
  return upper_tail((ranked.u - m * n / 2 - 0.5) / std::sqrt(variance));
}

std::vector<double> holm_adjusted(std::span<const double> p_values) {
  std::vector<std::size_t> order(p_values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return p_values[i]; });
  std::vector<double> adjusted(p_values.size());
  double so_far = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const auto left = static_cast<double>(order.size() - i);
    so_far = std::max(so_far, std::min(1.0, left * p_values[order[i]]));
    adjusted[order[i]] = so_far;
  }
  return adjusted;
}

double sign_test_p(std::span<const double> values, double limit) {
  const auto above = std::ranges::count_if(values, [&](double value) { return value > limit; });
  return values.empty() ? 1 : binomial_tail(values.size(), static_cast<std::size_t>(above));
}

double sign_test_p_below(std::span<const double> values, double limit) {
  const auto below = std::ranges::count_if(values, [&](double value) { return value < limit; });
  return values.empty() ? 1 : binomial_tail(values.size(), static_cast<std::size_t>(below));
}

std::optional<double> median_lower_bound(std::span<const double> values, double confidence) {
  assert(confidence > 0.5 && confidence < 1);
  std::vector<double> sorted(values.begin(), values.end());
  std::ranges::sort(sorted);
  // The kth smallest is above the median only if fewer than k values are below it.
  std::optional<double> bound;
  for (std::size_t k = 1; 2 * k <= sorted.size(); ++k) {
    if (binomial_tail(sorted.size(), sorted.size() - k + 1) > 1 - confidence) break;
    bound = sorted[k - 1];
  }
  return bound;
}

std::optional<double> median_upper_bound(std::span<const double> values, double confidence) {
  std::vector<double> negative;
  for (const double value : values) negative.push_back(-value);
  const auto bound = median_lower_bound(negative, confidence);
  return bound ? std::optional(-*bound) : std::nullopt;
}

double median_of(std::span<const double> values) {
  assert(!values.empty());
  std::vector<double> sorted(values.begin(), values.end());
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::ranges::nth_element(sorted, middle);
  if (sorted.size() % 2 == 1) return *middle;
  return (*middle + *std::max_element(sorted.begin(), middle)) / 2;
}

}  // namespace pirt
