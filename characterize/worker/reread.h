// How fast caches forget: what a robot's call finds of its data depends on how long ago it ran.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "characterize/profile/unit_phase.h"
#include "characterize/worker/cache_sweep.h"
#include "workloads/base/system/large_memory.h"
#include "workloads/base/time.h"

namespace pirt {

/// Reads an eighth of what the last caches that a unit reaches hold, again and again. Where others
/// use those caches, too (other units, other machines on the same processor), they lose it in time,
/// whether the unit sleeps or not.
class Reread {
 public:
  /// Whether the machine says how much its caches hold, and there is memory enough for as much.
  [[nodiscard]] static bool possible(const std::vector<int>& cores);
  /// 0 to 100 ms: 2.3 s in all.
  [[nodiscard]] static std::span<const SleepPlan> plans();

  /// @param cores  The unit's; at least one. It reads on the first of them.
  explicit Reread(std::vector<int> cores);

  /// @return What reading takes after each sleep, before which the same was read.
  /// @throws Error{kEnvironment} if the thread cannot run there.
  [[nodiscard]] std::vector<Nanos> after(const SleepPlan& plan);
  /// The same after as many other bytes as the caches hold.
  [[nodiscard]] std::vector<Nanos> cold(int samples);

 private:
  [[nodiscard]] Nanos read() const;

  std::vector<int> cores_;
  LargeMemory memory_;
  CacheSweep sweep_;
};

}  // namespace pirt
