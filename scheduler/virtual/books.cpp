#include "scheduler/virtual/books.h"

#include <utility>

namespace pirt {

Books::Books(const Scenario& scenario) : scenario_(scenario) {
  const std::size_t units = scenario.platform.units.size();
  tally_.units.resize(units);
  tally_.calls.assign(scenario.services.workloads.size(), std::vector<Histogram>(units));
}

void Books::charge_computed(WorkloadId workload, UnitId unit, Nanos busy, Nanos powered,
                            double own_part) {
  tally_.units[unit].busy += busy;
  if (!is_metered(workload, unit)) tally_.units[unit].powered += powered;
  const Service* service = scenario_.services.find(workload, unit);
  if (service != nullptr) charge_own(unit, own_part * service->fixed_j());
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
  return tally;
}

}  // namespace pirt
