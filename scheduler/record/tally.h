// What a run counts while it goes: sums and histograms, nothing that grows with the number of
// tasks.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "scheduler/mix/task.h"
#include "scheduler/record/histogram.h"
#include "workloads/base/time.h"

namespace pirt {

struct UnitTally {
  std::int64_t completed = 0;
  Histogram latency;  ///< Dispatch to completion.
  Nanos busy{0};      ///< Server time that this unit served, whoever it worked for.
  Nanos powered{0};   ///< The part of it that draws active_w: unscaled, and not of metered calls.
  Nanos transferring{0};      ///< Time that the unit's link was busy for it.
  std::int64_t prepares = 0;  ///< Calls of another context than the last.
  Nanos preparing{0};         ///< The part of `busy` that these took.
  double own_j = 0;           ///< Of its calls, beyond busy servers and links.
};

struct PipelineTally {
  std::int64_t fired = 0;
  std::int64_t completed = 0;       ///< All tasks completed.
  std::int64_t dropped = 0;         ///< Found no buffer, or lost a task on the way.
  std::int64_t no_predecessor = 0;  ///< Of `dropped`: no earlier firing made what they read.
  std::int64_t unfinished = 0;      ///< The others.
  bool ran = false;         ///< A task of it completed, failed, or was on a unit at the end.
  std::int64_t queued = 0;  ///< Of these, those that came more than a period, or a deadline, ago.
  std::int64_t deadline_misses = 0;  ///< Completed late, or unfinished after its deadline.
  Histogram latency;                 ///< Firing to the last task's completion.
};

struct CallPhases {
  Histogram upload, launch, execute, download;
};

struct Tally {
  std::vector<UnitTally> units;
  std::vector<PipelineTally> pipelines;
  /// Of completed calls, [workload][unit]: how long each was on its unit, with what it shared it
  /// with; of computed ones what the call itself took.
  std::vector<std::vector<Histogram>> calls;
  /// Of computed calls that completed: what their phases took, by workload and unit.
  std::map<std::pair<WorkloadId, UnitId>, CallPhases> phases;
  std::int64_t refused_tasks = 0;  ///< Of firings that found no buffer; no dispatcher saw them.
  TaskCounts tasks;                ///< Of the dispatcher.
  Nanos end{0};                    ///< When this was counted: the duration, or the last completion.
  Nanos last_completion{0};        ///< Of the whole run, which may be after `end`.
  std::int64_t stalled = 0;        ///< Tasks that nothing was ever going to start.
};

}  // namespace pirt
