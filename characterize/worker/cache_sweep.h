// Filling a unit's own caches with other bytes than its workload's.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

/// Streams through as many bytes as the unit's own caches hold (own_cache_bytes), on each of its
/// cores its part. What other cores share, others fill and empty: it says nothing of this unit.
class CacheSweep {
 public:
  /// @param cores  The unit's; empty = all that the calling thread may use.
  explicit CacheSweep(std::vector<int> cores);

  /// Whether there is a cache to sweep.
  [[nodiscard]] bool possible() const { return !words_.empty(); }
  /// Reads and writes each line. The calling thread visits the cores and may use those afterwards
  /// that it could before.
  void run();

 private:
  std::vector<int> cores_;
  std::vector<std::uint64_t> words_;
};

}  // namespace pirt
