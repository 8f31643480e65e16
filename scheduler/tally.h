// What a run counts while it goes: sums and histograms, nothing that grows with the number of
// tasks.
#pragma once

#include <cstdint>
#include <vector>

#include "scheduler/histogram.h"
#include "workloads/base/time.h"

namespace pirt {

struct UnitTally {
  std::int64_t completed = 0;
  Histogram latency;  ///< Dispatch to completion.
  Nanos busy{0};      ///< Server time of stages on this unit, whoever they work for.
  Nanos powered{0};   ///< The part of it that draws active_w: unscaled, and not of metered calls.
  Nanos transferring{0};  ///< Time that the unit's link was busy for it.
  double extra_j = 0;     ///< Filled in at the end of the run from `calls`.
};

struct PipelineTally {
  std::int64_t fired = 0;
  std::int64_t completed = 0;        ///< All tasks completed.
  std::int64_t dropped = 0;          ///< Found no buffer, or lost a task on the way.
  std::int64_t deadline_misses = 0;  ///< Completed, but late.
  Histogram latency;                 ///< Firing to the last task's completion.
  Nanos last_completion{0};
};

struct Tally {
  std::vector<UnitTally> units;
  std::vector<PipelineTally> pipelines;
  std::vector<std::vector<std::int64_t>> calls;  ///< Started, [workload][unit].
  Histogram latency;               ///< Of all completed tasks, dispatch to completion.
  std::int64_t refused_tasks = 0;  ///< Of firings that found no buffer; no dispatcher saw them.
  Nanos last_completion{0};
};

}  // namespace pirt
