#include "characterize/statistics/rank_tests.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

namespace pirt {
namespace {

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
