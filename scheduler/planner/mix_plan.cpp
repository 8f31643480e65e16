#include "scheduler/planner/mix_plan.h"

#include <algorithm>
#include <map>
#include <utility>

#include "scheduler/services/call_plan.h"

namespace pirt {
namespace {

/// The mix as one task graph: a firing of each pipeline, all at time 0. A task's cost is its
/// service's total with what a call moves over the unit's link; data of edges moves as edges_into
/// says.
TaskGraph graph_of(const Scenario& scenario) {
  const Platform& platform = scenario.platform;
  const Mix& mix = scenario.mix;
  TaskGraph graph;
  // By state: the last task that holds it, among those that follow one plan together.
  std::vector<std::optional<std::size_t>> holder(mix.states.size());
  for (std::size_t p = 0; p < mix.pipelines.size(); ++p) {
    const Pipeline& pipeline = mix.pipelines[p];
    const std::size_t first = graph.costs.size();
    if (!mix.fires_once()) std::ranges::fill(holder, std::nullopt);
    for (std::size_t t = 0; t < pipeline.tasks.size(); ++t) {
      const MixTask& task = pipeline.tasks[t];
      const TaskClass& kind = scenario.classes[p][t];
      graph.names.push_back(pipeline.name + "/" + task.name);
      auto& row = graph.costs.emplace_back(platform.units.size(), kUnsupported);
      for (UnitId unit = 0; unit < row.size(); ++unit) {
        if (!contains(kind.eligible, unit)) continue;
        const CallPlan call =
            plan_call(platform, scenario.services, kind.workload, unit, call_bytes(task));
        row[unit] = std::max(call.takes(Taken::kMean), Nanos(1));
      }
      for (auto& edge : edges_into(platform, pipeline, t)) {
        edge.from += first;
        edge.to += first;
        graph.edges.push_back(std::move(edge));
      }
      if (!task.state) continue;
      // Tasks get a state in this order: a plan in another one would wait for ever.
      auto& last = holder[*task.state];
      if (last) graph.edges.push_back({.from = *last, .to = first + t});
      last = first + t;
    }
  }
  return graph;
}

}  // namespace

MixPlan plan_mix(const Scenario& scenario, Planner planner) {
  const Mix& mix = scenario.mix;
  const Plan plan = planner(PlanningGraph(graph_of(scenario)));
  MixPlan result;
  result.makespan = plan.makespan;
  for (const auto& task : plan.tasks) {
    result.entries.push_back(
        {.unit = task.unit, .start = task.start, .finish = task.finish, .previous = {}});
  }
  // A pipeline that finds no image buffer is not there to be waited for.
  const auto images = std::ranges::count_if(mix.pipelines, &Pipeline::has_image_input);
  const bool together = mix.fires_once() && images <= mix.image_buffers.value_or(images);
  std::vector<std::size_t> group;
  for (std::size_t p = 0; p < mix.pipelines.size(); ++p) {
    group.insert(group.end(), mix.pipelines[p].tasks.size(), together ? 0 : p);
  }
  for (const auto& order : plan.order) {
    std::map<std::size_t, std::uint32_t> last;  // By group.
    for (const std::size_t task : order) {
      const auto entry = static_cast<std::uint32_t>(task);
      const auto [before, is_first] = last.try_emplace(group[task], entry);
      if (is_first) continue;
      result.entries[task].previous = before->second;
      before->second = entry;
    }
  }
  return result;
}

}  // namespace pirt
