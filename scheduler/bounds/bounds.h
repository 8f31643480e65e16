// What no scheduler could beat on the same platform with the same services: the distance to it is
// what a mode gives away.
//
// All are relaxations, so each is a true bound and none need be reachable: tasks may be split over
// units, queues and the order of tasks cost nothing, links limit nothing, and drawn times take
// their least value.
//
// @source Area bound, critical path: Graham, "Bounds on multiprocessing timing anomalies" (1969).
// Fractional assignment to unrelated machines: Lawler and Labetoulle, "On preemptive scheduling of
// unrelated parallel processors" (1978).
#pragma once

#include <optional>
#include <vector>

#include "scheduler/record/run_record.h"
#include "scheduler/services/call_plan.h"
#include "scheduler/services/eligibility.h"
#include "scheduler/services/scenario.h"

namespace pirt {

/// What one task of a pipeline asks of the platform, on one unit.
struct UnitWork {
  UnitId unit = 0;
  std::vector<double> server_ms;       ///< By unit: server time on it, scaled.
  double total_ms = 0;                 ///< All stages, one after the other.
  std::optional<double> energy_j = 0;  ///< Without idle power; absent where nobody knows it.
};

struct TaskWork {
  std::vector<UnitWork> units;     ///< Those that may serve it; never empty.
  std::vector<std::size_t> after;  ///< Positions in PipelineWork::tasks, all before this one.
};

struct PipelineWork {
  std::vector<TaskWork> tasks;
  std::optional<double> per_ms;  ///< Firings; absent in closed loops.
};

struct UnitCapacity {
  double servers = 1;
  std::optional<int> slots;  ///< Tasks on it at a time.
};

/// A mix as its bounds see it.
struct Work {
  std::vector<UnitCapacity> units;
  std::vector<PipelineWork> pipelines;
  double idle_w = 0;  ///< Of all units.
};

/// @param cloud_use  Which tasks the mode gives to units of role cloud; others do not count as able
/// to go there, since a cloud that misses every deadline is no alternative.
[[nodiscard]] Work work_of(const Scenario& run, CloudUse cloud_use, Taken taken = Taken::kLeast);

/// Throughput programme: most tasks a millisecond, with no task more often than its predecessors or
/// its pipeline's rate. Absent if nothing limits it.
[[nodiscard]] std::optional<double> most_tasks_per_ms(const Work& work);

/// Energy programme: least joules for so many firings of each pipeline within @p makespan_ms.
/// Absent if they do not fit, or if nobody knows the joules of a unit that may serve them.
[[nodiscard]] std::optional<double> least_energy_j(const Work& work,
                                                   const std::vector<double>& firings,
                                                   double makespan_ms);

/// Area bound: the least time in which the units can do so many firings, whatever their order.
[[nodiscard]] std::optional<double> area_ms(const Work& work, const std::vector<double>& firings);

/// The longest chain of a firing, each task on its fastest unit.
[[nodiscard]] double critical_path_ms(const PipelineWork& pipeline);

/// All of them for a run that was done.
[[nodiscard]] RunBounds bounds_of(const Scenario& run, CloudUse cloud_use, const RunRecord& record);

}  // namespace pirt
