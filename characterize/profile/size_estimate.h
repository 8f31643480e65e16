// Workloads at a size that nobody has measured, NAME@WIDTHxHEIGHT, between sizes that somebody has.
//
// A row of one size is never another's. Who asks for it gets times of a model, a + b n^c through
// the measured ones, which are marked as such and have its interval; never beyond the smallest and
// the largest.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "characterize/profile/profile.h"

namespace pirt {

/// What a call took at one size.
struct SizedTime {
  double elements = 0;  ///< Of the first output, or input if that is a list; above 0.
  double time_s = 0;    ///< Above 0.
};

/// time_s = a + b * elements^c, a and b at least 0.
struct SizeFit {
  double a = 0, b = 0, c = 1;
  [[nodiscard]] double at(double elements) const;
};

/// The least squares of relative errors, c from 0.1 to 3.
/// @param times  Of 3 different sizes at least.
[[nodiscard]] SizeFit fit_sizes(std::span<const SizedTime> times);

/// Through so many different sizes at least, of which two are between others.
inline constexpr std::size_t kLeastSizes = 4;

/// How far off fit_sizes may be between the sizes: ln(truth / fit) is within plus and minus this.
/// Three times the largest such error that it makes at an inner size which it was not shown. The
/// largest of two errors alone is exceeded by another one in 1 of 3 cases; three times it holds 9
/// of 10.
/// @param times  Of kLeastSizes different sizes at least, rising.
[[nodiscard]] double log_error_of_fit(std::span<const SizedTime> times);

/// A workload with a size in its name, and a unit that has rows of other sizes and none of this.
struct SizeGap {
  std::string workload, unit;
  std::vector<std::string> others;  ///< Workloads whose rows it has, sizes rising.
  std::string why_not;              ///< Why there can be no estimate; empty if there can.
  bool by_inputs = false;           ///< The sizes are those of inputs: outputs are alike in all.
};

/// Of @p workloads those with a size that a unit has no rows of.
[[nodiscard]] std::vector<SizeGap> size_gaps(const Profile& profile,
                                             const std::vector<std::string>& workloads);

/// Adds rows of the gap to the profile, of provenance `modelled`, with the interval of the model
/// and of the rows that it goes through: of each phase of a call if all of these have it, or else
/// of `call`.
/// @param gap  Without why_not.
/// @return     The row of `call`.
PhaseRow add_estimate(Profile& profile, const SizeGap& gap);

}  // namespace pirt
