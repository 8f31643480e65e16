// Failures that a run is given on purpose: a pure function of a seed, so that they can be had
// again.
#pragma once

#include <cstdint>

#include "scheduler/mix/task.h"
#include "workloads/base/math/random.h"

namespace pirt {

/// Of the calls that end, these parts do not complete.
struct Faults {
  std::uint64_t seed = 1;
  double failing = 0.02;    ///< The task fails,
  double returning = 0.02;  ///< or its unit gives it back.

  /// What becomes of a call.
  /// @param stream  Tells the pipeline, @p task its place there.
  /// @param tries   How often it was started before.
  [[nodiscard]] Outcome outcome(std::uint64_t stream, std::uint64_t firing, std::uint64_t task,
                                std::uint32_t tries) const {
    const double draw =
        static_cast<double>(
            hash_u64(hash_u64(hash_u64(hash_u64(seed, stream), firing), task), tries) >> 11U) *
        0x1p-53;
    if (draw < failing) return Outcome::kFailed;
    return draw < failing + returning ? Outcome::kReturned : Outcome::kCompleted;
  }
};

}  // namespace pirt
