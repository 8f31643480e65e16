#include "scheduler/services/recall.h"

#include <algorithm>

#include "characterize/platform/elsewhere.h"
#include "scheduler/services/call_plan.h"

namespace pirt {
namespace {

/// Threads that wake up one after the other before the call begins, each as a unit's does that is
/// handed a call: who looks at the clock, who waits for the cloud's reply, and the unit's own.
constexpr int kWakeUps = 3;

}  // namespace

bool may_return(const Scenario& scenario, CloudUse cloud_use) {
  if (scenario.faults || std::ranges::any_of(scenario.platform.units, is_elsewhere)) return true;
  for (std::size_t p = 0; p < scenario.mix.pipelines.size(); ++p) {
    const Pipeline& pipeline = scenario.mix.pipelines[p];
    if (!pipeline.deadline || pipeline.real_time || cloud_use == CloudUse::kNone) continue;
    const auto leads = recall_leads(scenario, p);
    if (std::ranges::any_of(leads, [](const auto& lead) { return lead.has_value(); })) return true;
  }
  return false;
}

std::vector<std::optional<RecallLead>> recall_leads(const Scenario& scenario,
                                                    std::size_t pipeline) {
  const UnitMask cloud = cloud_units(scenario.platform);
  const auto& tasks = scenario.mix.pipelines[pipeline].tasks;
  const std::vector<TaskPlan> plans = plan_tasks(scenario, pipeline);
  std::vector<std::optional<RecallLead>> leads(tasks.size());
  std::vector<Nanos> behind(tasks.size(), Nanos::zero());  // What comes after each takes.
  for (std::size_t t = tasks.size(); t-- > 0;) {
    const TaskClass& kind = scenario.classes[pipeline][t];
    const UnitMask here = kind.eligible & ~cloud;
    const UnitMask where = here != 0 ? here : kind.eligible;
    Nanos slowest{0};
    Nanos handover{0};
    for (UnitId unit = 0; unit < plans[t].calls.size(); ++unit) {
      if (!contains(where, unit)) continue;
      slowest = std::max(slowest, plans[t].calls[unit].takes(Taken::kWorst));
      handover = std::max(handover, plans[t].calls[unit].handover);
    }
    const Nanos takes = behind[t] + slowest;
    for (const std::size_t before : scenario.mix.pipelines[pipeline].waits_for(t))
      behind[before] = std::max(behind[before], takes);
    const UnitMask there = kind.eligible & cloud;
    if (here != 0 && there != 0) leads[t] = {takes + (kWakeUps - 1) * handover, there};
  }
  return leads;
}

}  // namespace pirt
