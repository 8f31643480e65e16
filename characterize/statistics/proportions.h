// Shares of a count: how far a rate may be from what was seen, and whether one is above another.
#pragma once

#include <cstdint>

namespace pirt {

/// How likely at most @p k of @p n are if each has probability @p p, in (0, 1).
[[nodiscard]] double binomial_cdf(std::int64_t k, std::int64_t n, double p);

/// The one-sided 95 % bounds of a rate that was seen @p k times in @p n. @source Clopper and
/// Pearson, Biometrika 26 (1934) 404.
[[nodiscard]] double rate_upper_bound(std::int64_t k, std::int64_t n);
[[nodiscard]] double rate_lower_bound(std::int64_t k, std::int64_t n);

/// One-sided: how likely the second share is to be so much the larger by chance, of @p a in @p n
/// and
/// @p b in @p m. @source Fisher, Statistical Methods for Research Workers, 5th ed. (1934), 21.02.
[[nodiscard]] double fisher_p(std::int64_t a, std::int64_t n, std::int64_t b, std::int64_t m);

}  // namespace pirt
