#include "scheduler/services/recall.h"

#include <algorithm>

namespace pirt {
namespace {

/// Threads that wake up one after the other before the call begins, each as a unit's does that is
/// handed a call: who looks at the clock, who waits for the cloud's reply, and the unit's own.
constexpr int kWakeUps = 3;

Nanos longest_handover(const ServiceTable& services, UnitId unit) {
  return services.units.empty() ? Nanos::zero() : services.units[unit].longest_handover;
}

/// When it takes long: its program has to be loaded, its caches are cold, and others compute beside
/// it.
Nanos at_worst(const Service& service, UnitId unit) {
  Nanos takes = service.prepare.value_or(Nanos::zero());
  for (const ServiceStage& stage : service.stages) {
    const Nanos usual = stage.usual_worst();
    const CallConditions* const varies = service.conditions_of(stage, unit);
    takes += varies == nullptr ? usual
                               : scaled(std::max(usual, scaled(varies->usual_worst, stage.scale)),
                                        std::max(varies->beside_memory, varies->beside_compute));
  }
  return takes;
}

struct Slowest {
  Nanos takes{0};  ///< From being handed over to its end.
  Nanos handover{0};
};

Slowest slowest(const ServiceTable& services, const TaskClass& kind, UnitMask among) {
  Slowest most;
  for (UnitId unit = 0; unit < services.entries[kind.workload].size(); ++unit) {
    const Service* const service = services.find(kind.workload, unit);
    if (!contains(among, unit) || service == nullptr) continue;
    const Nanos handover = longest_handover(services, unit);
    most.takes = std::max(most.takes, handover + at_worst(*service, unit));
    most.handover = std::max(most.handover, handover);
  }
  return most;
}

}  // namespace

std::vector<std::optional<RecallLead>> recall_leads(const Scenario& scenario,
                                                    std::size_t pipeline) {
  const UnitMask cloud = cloud_units(scenario.platform);
  const auto& tasks = scenario.mix.pipelines[pipeline].tasks;
  std::vector<std::optional<RecallLead>> leads(tasks.size());
  std::vector<Nanos> behind(tasks.size(), Nanos::zero());  // What comes after each takes.
  for (std::size_t t = tasks.size(); t-- > 0;) {
    const TaskClass& kind = scenario.classes[pipeline][t];
    const UnitMask here = kind.eligible & ~cloud;
    const Slowest own = slowest(scenario.services, kind, here);
    const Nanos takes = behind[t] + own.takes;
    for (const std::size_t before : tasks[t].after)
      behind[before] = std::max(behind[before], takes);
    const UnitMask there = kind.eligible & cloud;
    if (here != 0 && there != 0) leads[t] = {takes + (kWakeUps - 1) * own.handover, there};
  }
  return leads;
}

}  // namespace pirt
