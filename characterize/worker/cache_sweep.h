// Filling the caches that a unit reaches with other bytes than its workload's.
#pragma once

#include <cstdint>
#include <vector>

#include "workloads/base/system/large_memory.h"

namespace pirt {

/// Streams through so many bytes, on each of the unit's cores its part. As many as its own caches
/// hold (own_cache_bytes) empty those; what other cores share, others fill and empty as well, and
/// that takes as many as the last ones hold (reached_cache_bytes).
class CacheSweep {
 public:
  /// @param cores  The unit's; at least one.
  /// @param bytes  At least one line of 64.
  CacheSweep(std::vector<int> cores, std::int64_t bytes);

  /// Reads and writes each line. The calling thread visits the cores and may use those afterwards
  /// that it could before.
  void run();

 private:
  std::vector<int> cores_;
  LargeMemory memory_;
};

}  // namespace pirt
