// Where a clock begins anew: that of a simulator, or of a recorder, that was restarted.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

/// What is less is no restart.
inline constexpr Nanos kLeastRestart = std::chrono::seconds(1);

/// Positions of stamps that are more than @p least before the one in front of them, where a run of
/// at least three ends and another begins; of a fall that is no restart, of at least two. Some that
/// are far off, between which and the others the stamps jump both ways, are none.
[[nodiscard]] std::vector<std::size_t> restarts_of(const std::vector<Nanos>& stamps,
                                                   Nanos least = kLeastRestart);

/// The run between restarts that lasts longest, which is the same one for all topics: its first
/// position, and that behind its last.
[[nodiscard]] std::pair<std::size_t, std::size_t> longest_run(
    const std::vector<std::size_t>& restarts, const std::vector<Nanos>& stamps);

}  // namespace pirt
