#include "characterize/statistics/proportions.h"

#include <algorithm>
#include <cmath>

namespace pirt {
namespace {

/// Logarithm of n over k.
double log_choose(std::int64_t n, std::int64_t k) {
  const auto gamma = [](std::int64_t x) { return std::lgamma(static_cast<double>(x) + 1); };
  return gamma(n) - gamma(k) - gamma(n - k);
}

}  // namespace

double binomial_cdf(std::int64_t k, std::int64_t n, double p) {
  if (k >= n) return 1;
  double sum = 0;
  for (std::int64_t i = 0; i <= k; ++i) {
    const auto x = static_cast<double>(i), all = static_cast<double>(n);
    sum += std::exp(log_choose(n, i) + x * std::log(p) + (all - x) * std::log1p(-p));
  }
  return std::min(sum, 1.0);
}

double rate_upper_bound(std::int64_t k, std::int64_t n) {
  if (k >= n) return 1;
  double low = 0, high = 1;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (binomial_cdf(k, n, middle) > 0.05 ? low : high) = middle;
  }
  return high;
}

double rate_lower_bound(std::int64_t k, std::int64_t n) {
  return k <= 0 ? 0 : 1 - rate_upper_bound(n - k, n);
}

double fisher_p(std::int64_t a, std::int64_t n, std::int64_t b, std::int64_t m) {
  const std::int64_t all = a + b;
  double p = 0;
  for (std::int64_t k = b; k <= std::min(all, m); ++k) {
    if (all - k > n) continue;
    p += std::exp(log_choose(m, k) + log_choose(n, all - k) - log_choose(n + m, all));
  }
  return std::min(p, 1.0);
}

}  // namespace pirt
