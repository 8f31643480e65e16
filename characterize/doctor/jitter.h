// How evenly a machine computes: the same work again and again, timed.
//
// The only check that finds what a virtual machine does not show: neighbours on the sibling threads
// of its cores, in the caches and at the memory count neither as load nor as steal, and yet take a
// third of a core's arithmetic and half of the bandwidth.
#pragma once

#include <span>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

/// Equal pieces of arithmetic on one core.
struct CoreJitter {
  int core = 0;
  std::vector<Nanos> pieces;  ///< What each took, in order of time; 2 ms or more.
};

struct Jitter {
  std::vector<CoreJitter> cores;
  std::vector<Nanos> reading;  ///< Equal pieces of reading from memory, by the first core.
};

/// For half of @p duration, all of @p cores at once: multiply-adds that fill a core's arithmetic
/// and touch no memory. For the other half, the first core alone: reading twice the last cache, or
/// the part of it that the system gives in good time. The first fifth of each, in which a clock may
/// still rise, is left out; what is left has at least one piece.
/// @param cores  At least one.
/// @throws Error{kEnvironment} if a core may not be used.
[[nodiscard]] Jitter measure_jitter(const std::vector<int>& cores, Nanos duration);

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
