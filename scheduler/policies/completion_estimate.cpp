#include "scheduler/policies/completion_estimate.h"

#include <algorithm>

#include "scheduler/policies/unit_order.h"

namespace pirt {

CompletionEstimate::CompletionEstimate(const PolicySetup& setup)
    : local_(local_units(setup.roles)), times_(setup.times) {
  for (const int servers : setup.servers) {
    idle_at_.emplace_back(static_cast<std::size_t>(servers), Nanos::zero());
  }
}

std::optional<UnitId> CompletionEstimate::best_unit(const TaskClass& task,
                                                    const UnitsView& units) const {
  std::optional<UnitId> best;
  for (UnitId unit = 0; unit < idle_at_.size(); ++unit) {
    if (!contains(task.eligible & units.up & local_, unit)) continue;
    if (!best || completion(task, unit, units) < completion(task, *best, units)) best = unit;
  }
  return best;
}

bool CompletionEstimate::has_idle_server(UnitId unit, const UnitsView& units) const {
  return static_cast<std::size_t>(units.load[unit]) < idle_at_[unit].size();
}

Nanos CompletionEstimate::completion(const TaskClass& task, UnitId unit,
                                     const UnitsView& units) const {
  const Nanos idle = has_idle_server(unit, units) ? units.now : std::ranges::min(idle_at_[unit]);
  return std::max(idle, units.now) + time(task, unit).total;
}

bool CompletionEstimate::has_room(const TaskClass& task, UnitId unit,
                                  const UnitsView& units) const {
  const ServiceTime& service = time(task, unit);
  // Before the next task the unit is busy with load of them for load x occupied / servers.
  const auto servers = static_cast<Nanos::rep>(idle_at_[unit].size());
  return units.load[unit] * service.occupied < servers * service.total;
}

void CompletionEstimate::add(const TaskClass& task, UnitId unit, const UnitsView& units) {
  auto& servers = idle_at_[unit];
  if (units.load[unit] == 0) std::ranges::fill(servers, units.now);
  const auto first = std::ranges::min_element(servers);
  *first = std::max(*first, units.now) + time(task, unit).occupied;
}

}  // namespace pirt
