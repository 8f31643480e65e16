// One call of a task on a unit: the steps that it goes through, and what follows from them, which
// is what it takes, holds and draws. Nowhere else is that said: virtual time runs the steps, and
// who plans, bounds or guarantees adds them up.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "scheduler/mix/mix.h"
#include "scheduler/mix/task.h"
#include "scheduler/services/scenario.h"
#include "scheduler/services/transfers.h"
#include "workloads/base/time.h"

namespace pirt {

/// Which time of a call counts, and for whom.
enum class Taken : std::uint8_t {
  kLeast,       ///< Bounds, which stay below every run.
  kMean,        ///< Planners and policies. As the one before, its unit holds its program.
  kUsualWorst,  ///< Guarantees and foresight: p95, data on its way and a program to load.
  kWorst,       ///< Recall: the same with cold caches and beside all neighbours.
  kHighest,     ///< A cap of power: no call takes longer than this.
};

/// One thing after the other.
struct CallStep {
  static constexpr std::uint32_t kDelay = UINT32_MAX;
  /// Position among the run's servers, units in order and then links; or a pure delay.
  std::uint32_t servers = kDelay;
  Distribution time;  ///< Before the scale.
  Nanos usual{0};     ///< Before the scale: what 95 of 100 do not exceed.
  Nanos scaled{0};    ///< Of a constant; the mean of another.
  double scale = 1;   ///< Stretches the time; what it draws stays.
  double watts = 0;   ///< While a server works on it at a scale of 1.
  double own_j = 0;   ///< Its part of the call's own joules, drawn evenly while it lasts.
  /// Of its time before the scale, the part that draws the unit's active_w.
  double energy_scale = 0;
  double beside = 1;          ///< At most so many times as long, by what else runs.
  bool prepares = false;      ///< Of a unit with contexts: not where it holds this one already.
  std::uint32_t context = 0;  ///< Of one that prepares: which.
  bool for_data = false;      ///< A delay until the data of the predecessors is there.
  /// Of the phase `execute`: what else it may take; refers to the scenario's services. Null = no.
  const CallConditions* conditions = nullptr;
  /// Parts after each of which but the last the call can be suspended, as shares; of the scenario's
  /// services. Null = none.
  const std::vector<double>* slices = nullptr;

  /// The part of its time, before the scale, that draws the unit's active_w.
  [[nodiscard]] Nanos powered(Nanos unscaled) const {
    return energy_scale == 1 ? unscaled : pirt::scaled(unscaled, energy_scale);
  }
  /// What it draws of its call's own joules while it takes so long; 0 where that is no time.
  [[nodiscard]] double own_w(Nanos takes) const {
    return own_j == 0 || takes <= Nanos::zero() ? 0 : own_j / to_s(takes);
  }
  [[nodiscard]] Nanos before_scale(Taken taken) const;
  [[nodiscard]] Nanos takes(Taken taken) const;
};

/// What a cap of power is about: the joules of any so long a time.
inline constexpr Nanos kPowerWindow = std::chrono::seconds(1);

/// What a call is expected to cost on a unit that nobody else uses, for policies.
struct CallCost {
  Nanos total{0};
  /// Of which it occupies one of the unit's servers, so that the next one waits.
  Nanos occupied{0};
  std::optional<double> energy_j = 0;  ///< Above idle; absent where nobody knows it.
  Origin energy_provenance = Provenance::kModelled;
};
/// [workload][unit]; absent where there is no service.
using CostTable = std::vector<std::vector<std::optional<CallCost>>>;

struct CallPlan {
  std::vector<CallStep> steps;  ///< Empty where the unit may not serve the task.
  double data_j = 0;  ///< At most: of links over which data of predecessors, and a state, comes.
  bool energy_known = true;
  Nanos handover{0};  ///< Until its unit begins with it, at most: of kUsualWorst and kWorst.
  Nanos leave{0};     ///< That a call takes longer which lets it in, at most: likewise.

  /// From its start to its end, with the slot that it holds.
  [[nodiscard]] Nanos takes(Taken taken) const;
  /// Of that, what loading its program may take.
  [[nodiscard]] Nanos prepares() const;
  /// Server time on these.
  [[nodiscard]] Nanos on(std::uint32_t servers, Taken taken) const;
  /// The longest step on @p unit itself, or the longest of all where none is: at the mean.
  [[nodiscard]] Nanos bottleneck(UnitId unit) const;
  /// The longest time until it ends or can be suspended, without a program to load.
  [[nodiscard]] Nanos longest_slice() const;
  /// Joules above idle, with those of its links; absent where nobody knows them.
  [[nodiscard]] std::optional<double> energy_j(Taken taken) const;
  /// Beyond busy servers and links: a meter's, or call_j, operations and bytes.
  [[nodiscard]] double own_j() const;
  /// The most that can fall into kPowerWindow.
  [[nodiscard]] double window_j() const;
};

/// A call for which no data has to come but its own, which it moves over the unit's link: inputs,
/// the stages, outputs back, wherever the predecessor ran. The link is busy while it sends (bytes *
/// 8 / mbit_s); the latency that follows is a delay, during which it may send again.
/// @param services  Have a service for it, and outlive the plan.
[[nodiscard]] CallPlan plan_call(const Platform& platform, const ServiceTable& services,
                                 WorkloadId workload, UnitId unit, const CallBytes& bytes);

/// By Little's law so many calls keep all @p servers busy, each of which takes @p total and
/// occupies one for @p occupied; as many as there are numbers where that is no time.
[[nodiscard]] std::int64_t calls_in_service(int servers, Nanos total, Nanos occupied);

struct TaskPlan {
  WorkloadId workload = 0;
  std::vector<GraphEdge> edges;      ///< From its predecessors; empty if none takes time.
  std::optional<std::size_t> state;  ///< That it holds, where moving it takes time,
  GraphEdge state_edge = {};         ///< and how that moves.
  std::vector<CallPlan> calls;       ///< By unit.
};

/// Of one pipeline, by task: what a started task goes through on each unit that may take it.
/// @param scenario  Must outlive it.
[[nodiscard]] std::vector<TaskPlan> plan_tasks(const Scenario& scenario, std::size_t pipeline);

/// What policies are told of the scenario's calls: means. Of several tasks of a workload the one
/// that moves the most.
[[nodiscard]] CostTable call_costs(const Scenario& scenario);

}  // namespace pirt
