#include "characterize/statistics/rank_tests.h"

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <iterator>
#include <numeric>

#include "characterize/statistics/proportions.h"

namespace pirt {
namespace {

/// How likely at least @p k of @p n fair coins are heads.
double binomial_tail(std::int64_t n, std::int64_t k) { return binomial_cdf(n - k, n, 0.5); }

}  // namespace

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
  return values.empty() ? 1 : binomial_tail(std::ssize(values), above);
}

double sign_test_p_below(std::span<const double> values, double limit) {
  const auto below = std::ranges::count_if(values, [&](double value) { return value < limit; });
  return values.empty() ? 1 : binomial_tail(std::ssize(values), below);
}

std::optional<double> median_lower_bound(std::span<const double> values, double confidence) {
  assert(confidence > 0.5 && confidence < 1);
  std::vector<double> sorted(values.begin(), values.end());
  std::ranges::sort(sorted);
  // The kth smallest is above the median only if fewer than k values are below it.
  std::optional<double> bound;
  const std::int64_t count = std::ssize(sorted);
  for (std::int64_t k = 1; 2 * k <= count; ++k) {
    if (binomial_tail(count, count - k + 1) > 1 - confidence) break;
    bound = sorted[static_cast<std::size_t>(k - 1)];
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
