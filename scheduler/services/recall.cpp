#include "scheduler/services/recall.h"

#include <algorithm>

namespace pirt {
namespace {

Nanos slowest(const ServiceTable& services, const TaskClass& kind, UnitMask among) {
  Nanos most{0};
  for (UnitId unit = 0; unit < services.entries[kind.workload].size(); ++unit) {
    const Service* const service = services.find(kind.workload, unit);
    if (contains(among, unit) && service != nullptr) most = std::max(most, service->total());
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
    const Nanos takes = behind[t] + slowest(scenario.services, kind, here);
    for (const std::size_t before : tasks[t].after)
      behind[before] = std::max(behind[before], takes);
    const UnitMask there = kind.eligible & cloud;
    if (here != 0 && there != 0) leads[t] = {takes, there};
  }
  return leads;
}

}  // namespace pirt
