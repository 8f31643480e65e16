// What a started task goes through on each unit that may take it: a pure function of the scenario,
// made once before a run.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "scheduler/mix/mix.h"
#include "scheduler/mix/task.h"
#include "scheduler/services/scenario.h"
#include "scheduler/services/transfers.h"
#include "workloads/base/time.h"

namespace pirt {

/// One thing after the other.
struct TaskStep {
  static constexpr std::uint32_t kDelay = UINT32_MAX;
  /// Position among the run's servers, units in order and then links; or a pure delay.
  std::uint32_t servers = kDelay;
  Distribution time;  ///< Before the scale.
  Nanos scaled{0};    ///< Of a constant.
  double scale = 1;
  double energy_scale = 0;    ///< Of its time before the scale, what draws the unit's active_w.
  bool prepares = false;      ///< Of a unit with contexts: not where it holds this one already.
  std::uint32_t context = 0;  ///< Of one that prepares: which.
  bool for_data = false;      ///< A delay until the data of the predecessors is there.
  /// Of the phase `execute`: what else it may take; refers to the scenario's services. Null = no.
  const CallConditions* conditions = nullptr;
  /// Parts after each of which but the last the call can be left, as shares; of the scenario's
  /// services. Null = none.
  const std::vector<double>* slices = nullptr;

  /// The part of its time, before the scale, that draws the unit's active_w.
  [[nodiscard]] Nanos powered(Nanos unscaled) const {
    return energy_scale == 1 ? unscaled : pirt::scaled(unscaled, energy_scale);
  }
};

/// Data that a task waits for once it has started, with what it moves over links.
struct DataEdge {
  GraphEdge edge;
  std::int64_t size_bytes = 0;
  bool earlier = false;  ///< Of an earlier firing.
};

struct TaskPlan {
  WorkloadId workload = 0;
  std::vector<DataEdge> edges;               ///< From its predecessors; empty if none takes time.
  std::optional<std::size_t> state;          ///< That it holds, where moving it takes time.
  std::vector<std::vector<TaskStep>> steps;  ///< By unit; empty where it is not eligible.
};

/// Of one pipeline, by task.
[[nodiscard]] std::vector<TaskPlan> plan_tasks(const Scenario& scenario, std::size_t pipeline);

}  // namespace pirt
