// When a task with a deadline has to be back from the cloud, to be done in time by the robot
// itself.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "scheduler/mix/task.h"
#include "scheduler/services/scenario.h"

namespace pirt {

struct RecallLead {
  Nanos before_deadline{0};
  UnitMask from = 0;

  /// @param deadline  When the pipeline's last task should be complete.
  [[nodiscard]] Recall recall(Nanos deadline) const { return {deadline - before_deadline, from}; }
};

/// Whether a task may come back from the unit that it was given to: by faults, from elsewhere, or
/// since it is wanted back from the cloud.
[[nodiscard]] bool may_return(const Scenario& scenario, CloudUse cloud_use);

/// By task of the pipeline: what taking it back takes, and what it and the longest way from it to
/// the end take on the robot's own units, where one may serve it, on the slowest that may, since
/// nobody knows which will. Each when it takes long: handed to a unit that slept, with cold caches,
/// beside others, and let in by another where calls are suspended, as far as the profile knows of
/// that (p95). Absent for a task that no cloud may serve, or nobody else.
[[nodiscard]] std::vector<std::optional<RecallLead>> recall_leads(const Scenario& scenario,
                                                                  std::size_t pipeline);

}  // namespace pirt
