// Which unit serves how much of each task, by a linear programme: where a budget begins.
#pragma once

#include <optional>
#include <vector>

#include "scheduler/bounds/bounds.h"
#include "scheduler/policies/setup.h"

namespace pirt {

struct Goals {
  Objective objective = Objective::kRate;
  std::optional<double> min_rate_per_ms = {};
  std::optional<double> most_w = {};  ///< Above what is drawn idle.
};

struct Assignment {
  /// [entry][unit]: calls a millisecond.
  std::vector<std::vector<double>> calls_per_ms;
  double rate_per_ms = 0;  ///< Tasks.
};

/// Pipelines with a deadline at their rate where that fits, then the most tasks (rate, latency) or
/// as many as are wanted (energy), then the least energy for that.
/// @param urgent  By pipeline: it has a deadline.
/// @return        Absent if no rate above 0 keeps the goals.
[[nodiscard]] std::optional<Assignment> assign(const Work& work, const std::vector<bool>& urgent,
                                               const Goals& goals);

}  // namespace pirt
