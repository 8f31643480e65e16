#include "scheduler/planner/budget_plan.h"

#include <fmt/format.h>

#include <algorithm>

#include "scheduler/services/call_plan.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

double standing_w(const Platform& platform) {
  double sum = 0;
  for (const UnitModel& unit : platform.units) sum += unit.standing_w();
  return sum;
}

/// What keeps the unit's own servers busy with calls of the kind; no more than it takes.
int busy_with(const CallPlan& call, const UnitModel& unit, UnitId id) {
  constexpr int kNoLimit = 1'000'000;
  const int most = unit.slots.value_or(kNoLimit);
  const bool on_it = std::ranges::any_of(
      call.steps, [id](const CallStep& step) { return step.servers == id && !step.prepares; });
  if (!on_it) return most;
  const Nanos own = call.on(id, Taken::kMean);
  if (own <= Nanos::zero()) return std::min(most, unit.servers);
  const std::int64_t calls = calls_in_service(unit.servers, call.takes(Taken::kMean), own);
  return std::min(most, static_cast<int>(std::clamp<std::int64_t>(calls, 1, kNoLimit)));
}

/// So many calls of the kind are served by links and other units' servers in the time of one.
int served_elsewhere(const CallPlan& call, const Platform& platform, UnitId id) {
  constexpr int kNoLimit = 1'000'000;
  Nanos busiest{0};
  for (const CallStep& step : call.steps) {
    if (step.servers == id || step.servers == CallStep::kDelay) continue;
    const bool of_unit = step.servers < platform.units.size();
    const int servers = of_unit ? platform.units[step.servers].servers : 1;
    busiest = std::max(busiest, call.on(step.servers, Taken::kMean) / servers);
  }
  if (busiest <= Nanos::zero()) return kNoLimit;
  return static_cast<int>(
      std::clamp<std::int64_t>(call.takes(Taken::kMean) / busiest, 1, kNoLimit));
}

BudgetPlan::Task first_task(const Scenario& scenario, const TaskPlan& plan, std::uint32_t pipeline,
                            std::uint32_t position) {
  const Platform& platform = scenario.platform;
  const TaskClass& kind = scenario.classes[pipeline][position];
  const std::size_t units = platform.units.size();
  BudgetPlan::Task task{.pipeline = pipeline,
                        .first = position == 0,
                        .pinned = scenario.mix.pipelines[pipeline].deadline.has_value(),
                        .units = {},
                        .capacity = std::vector<int>(units, 0),
                        .share = std::vector<double>(units, 1.0),
                        .worst = std::vector<Nanos>(units, Nanos::zero()),
                        .context = std::vector<std::uint32_t>(units, 0),
                        .prepare = std::vector<Nanos>(units, Nanos::zero()),
                        .window_j = std::vector<double>(units, 0.0),
                        .slice = std::vector<Nanos>(scenario.slices ? units : 0, Nanos::zero()),
                        .state = scenario.mix.pipelines[pipeline].tasks[position].state,
                        .at_once = std::vector<int>(units, 1)};
  // A real-time task does not go to the cloud: where no other may serve it, it is refused later.
  const UnitMask here = kind.eligible & ~cloud_units(platform);
  const UnitMask usable = kind.real_time && here != 0 ? here : kind.eligible;
  std::vector<std::optional<double>> energy_j(units);
  for (UnitId unit = 0; unit < units; ++unit) {
    if (!contains(kind.eligible, unit)) continue;
    const CallPlan& call = plan.calls[unit];
    if (contains(usable, unit)) task.units.push_back(unit);
    task.capacity[unit] = busy_with(call, platform.units[unit], unit);
    task.at_once[unit] = served_elsewhere(call, platform, unit);
    task.prepare[unit] = call.prepares();
    task.worst[unit] = call.takes(Taken::kUsualWorst) - task.prepare[unit];
    if (scenario.slices) task.slice[unit] = call.longest_slice();
    const auto& contexts = platform.units[unit].contexts;
    task.context[unit] =
        contexts ? context_of(*contexts, kind.workload, scenario.services.workloads[kind.workload])
                 : kind.workload;
    task.window_j[unit] = call.window_j();
    energy_j[unit] = call.energy_j(Taken::kMean);
  }
  const bool known =
      std::ranges::all_of(task.units, [&](UnitId unit) { return energy_j[unit].has_value(); });
  std::ranges::stable_sort(task.units, [&](UnitId a, UnitId b) {
    if (known && *energy_j[a] != *energy_j[b]) return *energy_j[a] < *energy_j[b];
    return task.worst[a] < task.worst[b];
  });
  return task;
}

}  // namespace

const UnitModel* without_joules(const Scenario& scenario, const BudgetPlan& plan) {
  for (const auto& pipeline : scenario.classes) {
    for (const TaskClass& kind : pipeline) {
      for (const UnitId unit : plan.tasks[kind.entry].units) {
        if (scenario.services.find(kind.workload, unit)->energy_known) continue;
        return &scenario.platform.units[unit];
      }
    }
  }
  return nullptr;
}

double above_idle_j(const Platform& platform, double power_cap_w) {
  return (power_cap_w - standing_w(platform)) * to_s(kPowerWindow);
}

std::string infeasible_cap(const Platform& platform, double power_cap_w) {
  return fmt::format("--power-cap {:g} W is infeasible: the units of {} draw {:g} W idle",
                     power_cap_w, platform.name, standing_w(platform));
}

BudgetPlan first_budget_plan(const Scenario& scenario, std::optional<double> power_cap_w) {
  BudgetPlan plan;
  for (std::uint32_t p = 0; p < scenario.mix.pipelines.size(); ++p) {
    const Pipeline& pipeline = scenario.mix.pipelines[p];
    plan.pipelines.push_back({.rate_hz = pipeline.rate_hz,
                              .offset = pipeline.offset,
                              .jitter = pipeline.jitter,
                              .deadline = pipeline.deadline,
                              .real_time = pipeline.real_time});
    const std::vector<TaskPlan> plans = plan_tasks(scenario, p);
    for (std::uint32_t t = 0; t < plans.size(); ++t) {
      plan.tasks.push_back(first_task(scenario, plans[t], p, t));
    }
  }
  measure_ways(scenario, plan);
  if (power_cap_w) {
    if (const UnitModel* unit = without_joules(scenario, plan)) {
      throw_bad_input("--power-cap: nobody knows what " + unit->name +
                      " draws; give it with --set " + unit->name +
                      ".active_w=W, or leave it out with --without " + unit->name);
    }
    plan.window_j = above_idle_j(scenario.platform, *power_cap_w);
  }
  return plan;
}

void measure_ways(const Scenario& scenario, BudgetPlan& plan) {
  for (std::size_t p = 0; p < scenario.mix.pipelines.size(); ++p) {
    const auto& classes = scenario.classes[p];
    for (const TaskClass& kind : classes) plan.tasks[kind.entry].behind = Nanos::zero();
    for (std::size_t t = classes.size(); t-- > 0;) {
      const Nanos way = plan.tasks[classes[t].entry].way();
      for (const std::size_t each : scenario.mix.pipelines[p].waits_for(t)) {
        BudgetPlan::Task& before = plan.tasks[classes[each].entry];
        before.behind = std::max(before.behind, way);
      }
    }
  }
}

}  // namespace pirt
