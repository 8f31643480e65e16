#include "scheduler/virtual/books.h"

#include <utility>

namespace pirt {

Books::Books(const Scenario& scenario) : scenario_(scenario) {
  const std::size_t units = scenario.platform.units.size();
  tally_.units.resize(units);
  tally_.calls.assign(scenario.services.workloads.size(), std::vector<Histogram>(units));
}

void Books::charge_computed(WorkloadId workload, UnitId unit, Nanos busy, Nanos powered) {
  tally_.units[unit].busy += busy;
  if (!is_metered(workload, unit)) tally_.units[unit].powered += powered;
}

void Books::count_completed(WorkloadId workload, UnitId unit, Nanos call, Nanos latency) {
  tally_.calls[workload][unit].add(call);
  ++tally_.units[unit].completed;
  tally_.units[unit].latency.add(latency);
}

bool Books::is_metered(WorkloadId workload, UnitId unit) const {
  const Service* service = scenario_.services.find(workload, unit);
  return service != nullptr && service->metered_j.has_value();
}

Tally Books::close(Nanos end, const TaskCounts& tasks, const Firings& firings) && {
  Tally tally = std::move(tally_);
  tally.end = end;
  tally.tasks = tasks;
  tally.pipelines = firings.tallies();
  tally.refused_tasks = firings.refused_tasks();
  firings.count_unfinished(tally.pipelines, end);
  for (std::size_t w = 0; w < tally.calls.size(); ++w) {
    for (UnitId unit = 0; unit < tally.units.size(); ++unit) {
      const Service* service = scenario_.services.find(static_cast<WorkloadId>(w), unit);
      if (service == nullptr) continue;
      tally.units[unit].extra_j +=
          static_cast<double>(tally.calls[w][unit].count()) * service->fixed_j();
    }
  }
  return tally;
}

}  // namespace pirt
