#include "characterize/statistics/change_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace pirt {
namespace {

using Values = std::span<const double>;

/// Beyond this a split is a change: so far that one in 1000 values of AR(1) noise is taken for one.
/// Of short stretches the standard deviation is itself not known well; of long ones more may be
/// wrong.
double limit_of(std::size_t count) {
  return std::clamp(4.15 - 0.47 * std::log(static_cast<double>(count) / 50), 3.1, 4.7);
}

double mean_of(Values values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double squares_around(Values values, double mean) {
  double sum = 0;
  for (const double value : values) sum += (value - mean) * (value - mean);
  return sum;
}

/// How far the means of the values before and from @p at on are apart, by their standard deviation.
double distance_at(Values values, std::size_t at, double least_noise) {
  const Values before = values.first(at);
  const Values after = values.subspan(at);
  const double a = mean_of(before);
  const double b = mean_of(after);
  const auto free = static_cast<double>(values.size() - 2);
  const double variance = (squares_around(before, a) + squares_around(after, b)) / free;
  const double noise = std::max(std::sqrt(variance), least_noise);
  return std::abs(b - a) / (noise * std::sqrt(1 / static_cast<double>(before.size()) +
                                              1 / static_cast<double>(after.size())));
}

struct Split {
  std::size_t at = 0;  ///< 0: none is beyond the limit.
  double distance = 0;
};

/// The farthest split with at least so many values on either side.
Split farthest_split(Values values, std::size_t before, std::size_t after, double least_noise) {
  Split best{0, limit_of(values.size())};
  for (std::size_t at = before; at + after <= values.size(); ++at) {
    const double distance = distance_at(values, at, least_noise);
    if (distance > best.distance) best = {at, distance};
  }
  return best;
}

/// By so much a split before fewer values has to be farther than the best one before enough.
constexpr double kClearlyNewest = 1.3;

/// Adds the changes within values of @p begin to @p end; those of the newest few to @p suspected.
void split(Values all, std::size_t begin, std::size_t end, double least_noise,
           std::vector<std::size_t>& found, std::vector<std::size_t>& suspected) {
  const Values values = all.subspan(begin, end - begin);
  if (values.size() <= kFewestOfLevel) return;
  const Split best = farthest_split(values, kFewestOfLevel, kFewestOfLevel, least_noise);
  if (end == all.size()) {
    const std::size_t from = std::max(kFewestOfLevel, values.size() + 1 - kFewestOfLevel);
    const Split newest = farthest_split(values, from, 1, least_noise);
    if (newest.at != 0 && (best.at == 0 || newest.distance > kClearlyNewest * best.distance)) {
      suspected.push_back(begin + newest.at);
      return split(all.first(begin + newest.at), begin, begin + newest.at, least_noise, found,
                   suspected);
    }
  }
  if (best.at == 0) return;
  split(all, begin, begin + best.at, least_noise, found, suspected);
  found.push_back(begin + best.at);
  split(all, begin + best.at, end, least_noise, found, suspected);
}

}  // namespace

std::vector<ChangePoint> change_points(std::span<const double> values, double least_noise) {
  std::vector<std::size_t> at, suspected;
  split(values, 0, values.size(), least_noise, at, suspected);
  const std::size_t sure = at.size();
  // Of several in what was left, the first.
  if (!suspected.empty()) at.push_back(suspected.back());
  std::vector<ChangePoint> changes;
  for (std::size_t i = 0; i < at.size(); ++i) {
    const std::size_t from = i == 0 ? 0 : at[i - 1];
    const std::size_t to = i + 1 < at.size() ? at[i + 1] : values.size();
    changes.push_back({at[i], mean_of(values.subspan(from, at[i] - from)),
                       mean_of(values.subspan(at[i], to - at[i])), i < sure});
  }
  return changes;
}

double creep_of(std::span<const double> values, std::span<const ChangePoint> changes,
                double least_noise) {
  if (values.size() < 4) return 0;
  const std::size_t quarter = values.size() / 4;
  const double rise = mean_of(values.last(quarter)) - mean_of(values.first(quarter));
  for (const ChangePoint& change : changes) {
    if (std::abs(change.after - change.before) >= std::abs(rise) / 2) return 0;
  }
  // What differs from one value to the next has no share of a slow rise.
  std::vector<double> steps;
  for (std::size_t i = 1; i < values.size(); ++i) steps.push_back(values[i] - values[i - 1]);
  const double variance =
      squares_around(steps, mean_of(steps)) / (2 * static_cast<double>(steps.size()));
  const double noise = std::max(std::sqrt(variance), least_noise);
  // Of a few steps the noise is hardly known: as one in 1000 values of Student's t is beyond it.
  constexpr std::array kOfFew = {16.0, 9.0, 7.0, 6.0};
  const double beyond =
      values.size() - 4 < kOfFew.size() ? kOfFew[values.size() - 4] : limit_of(values.size());
  const double limit = beyond * noise * std::sqrt(2 / static_cast<double>(quarter));
  return std::abs(rise) > limit ? rise : 0;
}

}  // namespace pirt
