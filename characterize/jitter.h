// How evenly a core computes: the same work again and again, timed.
//
// The only check that finds what a virtual machine does not show: a neighbour on the sibling thread
// of a core counts neither as load nor as steal, and yet takes a third of its arithmetic.
#pragma once

#include <span>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

/// Equal pieces of work on one core.
struct CoreJitter {
  int core = 0;
  std::vector<Nanos> pieces;  ///< What each took, in order of time; about 5 ms.
};

/// Computes on all of @p cores at once for @p duration: multiply-adds that fill a core's arithmetic
/// and touch no memory. The first fifth, in which a clock may still rise, is left out; what is left
/// has at least one piece.
/// @throws Error{kEnvironment} if a core may not be used.
[[nodiscard]] std::vector<CoreJitter> measure_jitter(const std::vector<int>& cores, Nanos duration);

/// Where most of the pieces lie, relative to their median.
struct JitterRange {
  double low = 1;   ///< 5th percentile
  double high = 1;  ///< 95th
  /// Half of the distance between the two.
  [[nodiscard]] double spread() const { return (high - low) / 2; }
};

/// Needs at least one piece.
[[nodiscard]] JitterRange range_of(std::span<const Nanos> pieces);

}  // namespace pirt
