#include "scheduler/virtual/call_effects.h"

#include <algorithm>
#include <cmath>

namespace pirt {
namespace {

/// How far @p time is from the time below to the one above, linear in its logarithm: states of
/// sleep, and what others do meanwhile, are each about ten times as long as the one before.
double part_between(Nanos below, Nanos above, Nanos time) {
  if (below == Nanos::zero()) return to_s(time) / to_s(above);
  return std::log(to_s(time) / to_s(below)) / std::log(to_s(above) / to_s(below));
}

Nanos handover(const std::vector<UnitConditions::Handover>& rows, Nanos sleep,
               std::uint64_t random) {
  const auto above = std::ranges::lower_bound(rows, sleep, {}, &UnitConditions::Handover::sleep);
  if (above == rows.end()) return rows.back().time.draw(random);
  const Nanos high = above->time.draw(random);
  if (above == rows.begin() || above->sleep == sleep) return high;
  const auto& below = *(above - 1);
  const Nanos low = below.time.draw(random);
  return low + scaled(high - low, part_between(below.sleep, above->sleep, sleep));
}

double forgotten(const std::vector<UnitConditions::Forgotten>& rows, Nanos after) {
  const auto above = std::ranges::lower_bound(rows, after, {}, &UnitConditions::Forgotten::after);
  if (rows.empty()) return 0;
  if (above == rows.end()) return rows.back().part;
  if (above == rows.begin() || above->after == after) return above->part;
  const auto& below = *(above - 1);
  return below.part + part_between(below.after, above->after, after) * (above->part - below.part);
}

double part_of(std::int64_t bytes, std::int64_t cache) {
  if (cache <= 0) return 0;
  return std::min(1.0, static_cast<double>(bytes) / static_cast<double>(cache));
}

/// @param other  What runs beside it.
double slowdown(const CallConditions& conditions, const CallConditions& other) {
  return other.streams ? conditions.beside_memory : conditions.beside_compute;
}

}  // namespace

CallEffects::CallEffects(const Scenario& scenario)
    : scenario_(scenario), units_(scenario.services.units.size()) {
  for (Unit& unit : units_) unit.last.resize(scenario.services.workloads.size());
}

Nanos CallEffects::handed_over(UnitId id, Nanos now, std::uint64_t random) {
  Unit& unit = units_[id];
  const Nanos sleep = unit.tasks++ > 0 ? Nanos::zero() : now - unit.idle_since;
  const auto& rows = scenario_.services.units[id].handovers;
  return rows.empty() ? Nanos::zero() : handover(rows, sleep, random);
}

/// What the unit's caches have lost since the workload's last call there ended.
CallEffects::Coldness CallEffects::coldness(const Unit& unit, UnitId id, WorkloadId workload,
                                            Nanos now) const {
  const UnitConditions& known = scenario_.services.units[id];
  const Touched& last = unit.last[workload];
  if (!last.any) return {1, 1};
  const double by_time = forgotten(known.forgotten, now - last.at);
  // Caches of unknown size hold nothing.
  if (known.cache_bytes <= 0) return {1, by_time};
  return {std::max(by_time, part_of(unit.touched - last.by_unit, known.cache_bytes)),
          std::max(by_time, part_of(touched_beside(id) - last.by_all, known.last_cache_bytes))};
}

/// By calls of all units that share the unit's memory, its own included.
std::int64_t CallEffects::touched_beside(UnitId id) const {
  const std::string& memory = scenario_.services.units[id].memory;
  if (memory.empty()) return units_[id].touched;
  std::int64_t bytes = 0;
  for (UnitId each = 0; each < units_.size(); ++each) {
    if (scenario_.services.units[each].memory == memory) bytes += units_[each].touched;
  }
  return bytes;
}

Nanos CallEffects::executes(const Execution& execution, const CallConditions& conditions, Nanos now,
                            std::uint64_t random, std::vector<Slowed>& slowed) {
  Unit& unit = units_[execution.unit];
  Nanos takes = execution.steady;
  const Coldness cold = coldness(unit, execution.unit, execution.workload, now);
  const auto towards = [&](const std::optional<Distribution>& row, double part) {
    if (row && part > 0) takes += scaled(row->draw(random) - takes, part);
  };
  towards(conditions.cold_cache, cold.own);
  towards(conditions.cold_memory, cold.last);
  run(execution, &conditions, takes, now, slowed);
  return unit.ends - now;
}

bool CallEffects::is_beside(UnitId id, UnitId other) const {
  const std::string& memory = scenario_.services.units[id].memory;
  return id != other && !memory.empty() && scenario_.services.units[other].memory == memory;
}

/// The call runs on its unit from now on: it and what runs beside it slow each other while both do.
/// None becomes longer than beside others all the time.
void CallEffects::run(const Execution& execution, const CallConditions* conditions, Nanos alone,
                      Nanos now, std::vector<Slowed>& slowed) {
  Unit& unit = units_[execution.unit];
  Nanos more{0};
  Nanos most{0};
  for (UnitId id = 0; id < units_.size() && conditions != nullptr; ++id) {
    Unit& other = units_[id];
    if (!is_beside(execution.unit, id)) continue;
    most += scaled(alone, conditions->slowest_beside() - 1);
    if (other.ends <= now || other.conditions == nullptr) continue;
    const Nanos both = std::min(alone, other.ends - now);
    more += scaled(both, slowdown(*conditions, *other.conditions) - 1);
    const Nanos by =
        std::min(other.room, scaled(both, slowdown(*other.conditions, *conditions) - 1));
    if (by <= Nanos::zero()) continue;
    other.stretch *= to_s(other.ends - now + by) / to_s(other.ends - now);
    other.ends += by;
    other.room -= by;
    slowed.push_back({other.executing.job, id, by});
  }
  unit.executing = execution;
  unit.ends = now + alone + more;
  unit.stretch = alone > Nanos::zero() ? to_s(alone + more) / to_s(alone) : 1;
  unit.room = most - more;
  unit.conditions = conditions;
}

CallEffects::Rest CallEffects::suspend(UnitId id, Nanos now) {
  Unit& unit = units_[id];
  const Nanos takes = unit.ends - now;
  const Rest rest{unit.executing, takes, scaled(takes, 1 / unit.stretch), unit.conditions};
  unit.ends = now;
  unit.conditions = nullptr;
  return rest;
}

CallEffects::Resumed CallEffects::resume(UnitId id, const Rest& rest, Nanos now,
                                         std::uint64_t random, std::vector<Slowed>& slowed) {
  Unit& unit = units_[id];
  const UnitConditions& known = scenario_.services.units[id];
  // Handing over what was let in, which is part of leaving, has been counted.
  const Nanos handed =
      known.handovers.empty() ? Nanos::zero() : handover(known.handovers, Nanos::zero(), random);
  const Nanos passes =
      known.leave ? std::max(Nanos::zero(), known.leave->draw(random) - handed) : handed;
  run(rest.executing, rest.conditions, rest.alone, now, slowed);
  const double part = rest.takes > Nanos::zero() ? to_s(unit.ends - now) / to_s(rest.takes) : 1;
  unit.ends += passes;
  return {.passes = passes, .part = part};
}

void CallEffects::ended(UnitId id, WorkloadId workload, JobIndex job, Nanos now) {
  Unit& unit = units_[id];
  if (--unit.tasks == 0) unit.idle_since = now;
  const Service* service = scenario_.services.find(workload, id);
  if (service != nullptr && service->conditions) unit.touched += service->conditions->bytes;
  unit.last[workload] = {true, now, unit.touched, touched_beside(id)};
  // The next one may have begun by now.
  if (unit.executing.job == job) unit.ends = std::min(unit.ends, now);
}

}  // namespace pirt
