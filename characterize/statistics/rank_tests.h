// Tests on ranks and signs, for deciding whether something became slower: they hold whatever the
// distribution, and a few spikes do not move them.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace pirt {

/// p-values adjusted for having been looked at together: rejecting those below alpha is wrong
/// anywhere with probability alpha at most, however they depend on each other.
/// @return  In the order of @p p_values.
/// @source Holm, A simple sequentially rejective multiple test procedure, Scand. J. Statist. 6
/// (1979) 65.
[[nodiscard]] std::vector<double> holm_adjusted(std::span<const double> p_values);

/// One-sided sign tests: how likely at least as many of @p values are above (below) @p limit if
/// their median is @p limit. Values equal to it count as neither.
/// @return  In (0, 1]; 1 without values.
[[nodiscard]] double sign_test_p(std::span<const double> values, double limit);
[[nodiscard]] double sign_test_p_below(std::span<const double> values, double limit);

/// The largest of the values that the median is above with at least @p confidence, whatever the
/// distribution. Absent where there are too few values.
/// @param confidence  One-sided, in (0.5, 1).
[[nodiscard]] std::optional<double> median_lower_bound(std::span<const double> values,
                                                       double confidence);
[[nodiscard]] std::optional<double> median_upper_bound(std::span<const double> values,
                                                       double confidence);

/// Middle value, or the mean of the middle two. Needs at least one value.
[[nodiscard]] double median_of(std::span<const double> values);

}  // namespace pirt
