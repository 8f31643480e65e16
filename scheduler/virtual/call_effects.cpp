#include "scheduler/virtual/call_effects.h"

#include <algorithm>
#include <cmath>

namespace pirt {
namespace {

/// Between the rows whose sleeps are next to it, linear in the logarithm of the sleep: what wakes a
/// core up are states of sleep, each about ten times as deep as the one before.
Nanos handover(const std::vector<UnitConditions::Handover>& rows, Nanos sleep,
               std::uint64_t random) {
  const auto above = std::ranges::lower_bound(rows, sleep, {}, &UnitConditions::Handover::sleep);
  if (above == rows.end()) return rows.back().time.draw(random);
  const Nanos high = above->time.draw(random);
  if (above == rows.begin() || above->sleep == sleep) return high;
  const auto& below = *(above - 1);
  const Nanos low = below.time.draw(random);
  const double part = below.sleep == Nanos::zero()
                          ? to_s(sleep) / to_s(above->sleep)
                          : std::log(to_s(sleep) / to_s(below.sleep)) /
                                std::log(to_s(above->sleep) / to_s(below.sleep));
  return low + scaled(high - low, part);
}

/// @param other  What runs beside it.
double slowdown(const CallConditions& conditions, const CallConditions& other) {
  return other.streams ? conditions.beside_memory : conditions.beside_compute;
}

}  // namespace

CallEffects::CallEffects(const Scenario& scenario)
    : scenario_(scenario), units_(scenario.services.units.size()) {
  for (Unit& unit : units_) unit.touched_at.assign(scenario.services.workloads.size(), kNever);
}

Nanos CallEffects::handed_over(UnitId id, Nanos now, std::uint64_t random) {
  Unit& unit = units_[id];
  const Nanos sleep = unit.tasks++ > 0 ? Nanos::zero() : now - unit.idle_since;
  const auto& rows = scenario_.services.units[id].handovers;
  return rows.empty() ? Nanos::zero() : handover(rows, sleep, random);
}

/// What others touched since the workload's last call ended, over the unit's own caches.
double CallEffects::coldness(const Unit& unit, UnitId id, WorkloadId workload) const {
  const std::int64_t cache = scenario_.services.units[id].cache_bytes;
  const std::int64_t last = unit.touched_at[workload];
  if (last == kNever || cache <= 0) return 1;
  return std::min(1.0, static_cast<double>(unit.touched - last) / static_cast<double>(cache));
}

Nanos CallEffects::executes(const Execution& execution, const CallConditions& conditions, Nanos now,
                            std::uint64_t random, std::vector<Slowed>& slowed) {
  Unit& unit = units_[execution.unit];
  Nanos takes = execution.steady;
  if (conditions.cold) {
    const double f = coldness(unit, execution.unit, execution.workload);
    takes += scaled(conditions.cold->draw(random) - takes, f);
  }
  Nanos more{0};
  const std::string& memory = scenario_.services.units[execution.unit].memory;
  for (UnitId id = 0; id < units_.size(); ++id) {
    Unit& other = units_[id];
    const bool beside = id != execution.unit && !memory.empty() &&
                        scenario_.services.units[id].memory == memory && other.ends > now &&
                        other.conditions != nullptr;
    if (!beside) continue;
    const Nanos both = std::min(takes, other.ends - now);
    more += scaled(both, slowdown(conditions, *other.conditions) - 1);
    const Nanos by = scaled(both, slowdown(*other.conditions, conditions) - 1);
    if (by <= Nanos::zero()) continue;
    other.ends += by;
    slowed.push_back({other.executing.job, id, by});
  }
  unit.executing = execution;
  unit.ends = now + takes + more;
  unit.conditions = &conditions;
  return takes + more;
}

CallEffects::Rest CallEffects::leave(UnitId id, Nanos now) {
  Unit& unit = units_[id];
  const Rest rest{unit.executing, unit.ends - now, unit.conditions};
  unit.ends = now;
  unit.conditions = nullptr;
  return rest;
}

Nanos CallEffects::resume(UnitId id, const Rest& rest, Nanos now, std::uint64_t random) {
  Unit& unit = units_[id];
  const auto& rows = scenario_.services.units[id].handovers;
  const Nanos passes = rows.empty() ? Nanos::zero() : handover(rows, Nanos::zero(), random);
  unit.executing = rest.executing;
  unit.ends = now + passes + rest.takes;
  unit.conditions = rest.conditions;
  return passes;
}

void CallEffects::ended(UnitId id, WorkloadId workload, Nanos now) {
  Unit& unit = units_[id];
  if (--unit.tasks == 0) unit.idle_since = now;
  const Service* service = scenario_.services.find(workload, id);
  if (service != nullptr && service->conditions) unit.touched += service->conditions->bytes;
  unit.touched_at[workload] = unit.touched;
  unit.ends = std::min(unit.ends, now);
}

}  // namespace pirt
