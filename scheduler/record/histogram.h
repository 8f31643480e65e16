// Percentiles of durations in memory that does not grow with their number.
//
// Log-linear buckets, as HdrHistogram has them: 512 to an octave, so that a bucket is at most 1/512
// of its lower bound wide and its middle at most 1/1024 = 0.098 % off any value in it. Below 1024
// ns every value has its own bucket. There are buckets from the lowest value to the highest only:
// of a graph every task has a histogram, of one value.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

class Histogram {
 public:
  /// @param value  >= 0.
  void add(Nanos value);
  /// All that @p other has.
  void add(const Histogram& other);
  [[nodiscard]] std::int64_t count() const { return count_; }
  /// Absent if nothing was added. Exact but for the rounding of double.
  [[nodiscard]] std::optional<Nanos> mean() const;
  /// By nearest rank: the smallest value that at least @p fraction of all do not exceed, within 0.1
  /// %. Absent if nothing was added.
  /// @param fraction  In (0, 1].
  [[nodiscard]] std::optional<Nanos> percentile(double fraction) const;

 private:
  void cover(std::size_t low, std::size_t high);

  std::vector<std::int64_t> counts_;
  std::size_t first_ = 0;  ///< Bucket of counts_[0].
  std::int64_t count_ = 0;
  double sum_ns_ = 0;
  Nanos min_ = Nanos::max();
  Nanos max_ = Nanos::zero();
};

}  // namespace pirt
