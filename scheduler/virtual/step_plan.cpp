#include "scheduler/virtual/step_plan.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace pirt {
namespace {

bool takes_time(const GraphEdge& edge) {
  const auto any = [](const std::vector<Nanos>& times) {
    return std::ranges::any_of(times, [](Nanos time) { return time > Nanos::zero(); });
  };
  return edge.delay > Nanos::zero() || any(edge.leave) || any(edge.enter);
}

/// Empty if none takes time.
std::vector<DataEdge> data_edges(const Platform& platform, const Pipeline& pipeline,
                                 std::size_t task) {
  std::vector<DataEdge> edges;
  const auto& given = pipeline.tasks[task].edges;
  for (auto& edge : edges_into(platform, pipeline, task)) {
    edges.push_back({std::move(edge), given[edges.size()].bytes.value_or(0), false});
  }
  for (auto& [edge, size_bytes] : earlier_edges_into(platform, pipeline, task)) {
    edges.push_back({std::move(edge), size_bytes, true});
  }
  const auto takes = [](const DataEdge& each) { return takes_time(each.edge); };
  return std::ranges::any_of(edges, takes) ? edges : std::vector<DataEdge>{};
}

/// The link is busy while it sends (bytes * 8 / mbit_s); the latency that follows is a delay,
/// during which it may send again.
void add_transfer(const Platform& platform, UnitId unit, std::int64_t size_bytes,
                  std::vector<TaskStep>& steps) {
  const auto& name = platform.units[unit].link;
  if (name.empty()) return;
  const auto link = platform.links.find(name);
  const auto position = std::distance(platform.links.begin(), link);
  const Nanos sending = sending_time(link->second, size_bytes);
  steps.push_back({.servers = static_cast<std::uint32_t>(platform.units.size()) +
                              static_cast<std::uint32_t>(position),
                   .time = {.low = sending, .high = sending},
                   .scaled = sending});
  steps.push_back({.time = link->second.latency, .scaled = link->second.latency.mean()});
}

/// A call on a linked unit is: inputs over the link, the stages, outputs back. They travel at each
/// call, wherever the predecessor ran.
std::vector<TaskStep> plan_steps(const Scenario& scenario, const MixTask& task,
                                 const TaskPlan& plan, UnitId unit) {
  const Service& service = *scenario.services.find(plan.workload, unit);
  const bool moves_data = task.service.empty();
  const CallBytes bytes = call_bytes(task);
  std::vector<TaskStep> steps;
  if (!plan.edges.empty() || plan.state) steps.push_back({.time = {}, .for_data = true});
  if (moves_data) add_transfer(scenario.platform, unit, bytes.in, steps);
  if (service.prepare) {
    TaskStep& load = steps.emplace_back();
    load.servers = unit;
    load.time = {.low = *service.prepare, .high = *service.prepare};
    load.scaled = *service.prepare;
    load.energy_scale = service.metered_j ? 0.0 : 1.0;
    load.prepares = true;
    load.context =
        context_of(*scenario.platform.units[unit].contexts, plan.workload, task.workload);
  }
  const auto sliced = service.sliced_stage(unit);
  for (std::size_t i = 0; i < service.stages.size(); ++i) {
    const ServiceStage& stage = service.stages[i];
    steps.push_back({.servers = stage.on.value_or(TaskStep::kDelay),
                     .time = stage.time,
                     .scaled = stage.mean(),
                     .scale = stage.scale,
                     .energy_scale = service.energy_scale(stage),
                     .conditions = service.conditions_of(stage, unit)});
    if (i == sliced) steps.back().slices = &service.slices;
  }
  if (moves_data) add_transfer(scenario.platform, unit, bytes.out, steps);
  return steps;
}

}  // namespace

std::vector<TaskPlan> plan_tasks(const Scenario& scenario, std::size_t pipeline) {
  std::vector<TaskPlan> plans;
  const auto& tasks = scenario.mix.pipelines[pipeline].tasks;
  const bool links = !scenario.platform.links.empty();
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    const TaskClass& kind = scenario.classes[pipeline][t];
    TaskPlan plan{.workload = kind.workload,
                  .edges = data_edges(scenario.platform, scenario.mix.pipelines[pipeline], t),
                  .state = links ? tasks[t].state : std::nullopt,
                  .steps = {}};
    for (UnitId unit = 0; unit < scenario.platform.units.size(); ++unit) {
      plan.steps.push_back(contains(kind.eligible, unit)
                               ? plan_steps(scenario, tasks[t], plan, unit)
                               : std::vector<TaskStep>{});
    }
    plans.push_back(std::move(plan));
  }
  return plans;
}

}  // namespace pirt
