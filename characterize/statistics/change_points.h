// Where a series of figures, one after another in time, takes another level.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace pirt {

/// A level that begins at a value.
struct ChangePoint {
  std::size_t at = 0;            ///< The first value of the new level.
  double before = 0, after = 0;  ///< Means of the levels.
  /// False: it begins in the newest values, too few to be told from a spike.
  bool sure = true;
};

/// Values that a level has at least to be sure of it.
inline constexpr std::size_t kFewestOfLevel = 5;

/// Binary segmentation: the split of a stretch at which the means of both sides are farthest apart,
/// by the standard deviation of what is left, is a change if they are so by more than noise makes
/// of a stretch that long; then both sides are looked at in the same way. At the end of the series
/// one to four values may be a change that is not sure.
///
/// How much that is was simulated (2000 series a length) for noise without memory and for noise in
/// which a value has 0.3 of the one before (AR(1)), of which the latter decides: steps of three
/// standard deviations with five or more values on either side are found, and less than one change
/// in 1000 values is none. tests/bench/history.cpp has the counts.
/// @param values       Logarithms, so that a change is a ratio.
/// @param least_noise  Standard deviation that is taken at least: changes of a few of it count as
///                     none, however exactly the values repeat.
/// @return  In order.
/// @source  Scott and Knott, A cluster analysis method for grouping means in the analysis of
/// variance, Biometrics 30 (1974) 507.
[[nodiscard]] std::vector<ChangePoint> change_points(std::span<const double> values,
                                                     double least_noise);

/// What a series rose by without a step that explains it: the difference between the means of its
/// last and its first quarter, where that is no noise and no single step is half of it; 0 if there
/// is none.
/// @param changes  Those of change_points().
[[nodiscard]] double creep_of(std::span<const double> values, std::span<const ChangePoint> changes,
                              double least_noise);

}  // namespace pirt
