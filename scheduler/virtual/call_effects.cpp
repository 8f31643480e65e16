#include "scheduler/virtual/call_effects.h"

#include <algorithm>
#include <cmath>
#include <utility>

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
  if (rows.empty()) return Nanos::zero();
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
  return handover(scenario_.services.units[id].handovers, sleep, random);
}

/// By calls of all units that share the unit's memory, its own included.
std::int64_t CallEffects::touched_beside(UnitId id) const {
  const std::string& memory = scenario_.platform.units[id].memory;
  if (memory.empty()) return units_[id].touched;
  std::int64_t bytes = 0;
  for (UnitId each = 0; each < units_.size(); ++each) {
    if (scenario_.platform.units[each].memory == memory) bytes += units_[each].touched;
  }
  return bytes;
}

/// The last call that began there has touched what it does: where the next one begins before its
/// task has ended, that one finds the caches so.
void CallEffects::note_touched(UnitId id, Nanos now) {
  Unit& unit = units_[id];
  const CallConditions* const its = unit.executing.conditions;
  if (std::exchange(unit.noted, true) || its == nullptr) return;
  unit.touched += its->bytes;
  unit.last[unit.executing.workload] = Touched{now, unit.touched, touched_beside(id)};
}

Nanos CallEffects::executes(const Execution& execution, Nanos now, std::uint64_t random) {
  note_touched(execution.unit, now);
  const UnitConditions& known = scenario_.services.units[execution.unit];
  const Unit& unit = units_[execution.unit];
  // Which part of the unit's own caches, and of the last, holds nothing of the workload's any more.
  double own = 1;
  double last = 1;
  if (const auto& before = unit.last[execution.workload]) {
    last = forgotten(known.forgotten, now - before->at);
    if (known.cache_bytes > 0) {  // Those of unknown size hold nothing.
      own = std::max(last, part_of(unit.touched - before->by_unit, known.cache_bytes));
      last = std::max(
          last, part_of(touched_beside(execution.unit) - before->by_all, known.last_cache_bytes));
    }
  }
  Nanos takes = execution.steady;
  const auto towards = [&](const std::optional<Distribution>& row, double part) {
    if (row && part > 0) takes += scaled(scaled(row->draw(random), execution.scale) - takes, part);
  };
  towards(execution.conditions->cold_cache, own);
  towards(execution.conditions->cold_memory, last);
  run(execution, takes, now);
  return unit.ends - now;
}

/// The call runs on its unit from now on: it and what runs beside it slow each other while both do.
/// None becomes longer than beside others all the time.
void CallEffects::run(const Execution& execution, Nanos alone, Nanos now) {
  const CallConditions* const its = execution.conditions;
  const std::string& memory = scenario_.platform.units[execution.unit].memory;
  Unit& unit = units_[execution.unit];
  Nanos more{0};
  Nanos most{0};
  slowed_.clear();
  for (UnitId id = 0; id < units_.size() && !memory.empty(); ++id) {
    Unit& other = units_[id];
    if (id == execution.unit || scenario_.platform.units[id].memory != memory) continue;
    most += scaled(alone, its->slowest_beside() - 1);
    const CallConditions* const others = other.executing.conditions;
    if (other.ends <= now || others == nullptr) continue;
    const Nanos both = std::min(alone, other.ends - now);
    more += scaled(both, slowdown(*its, *others) - 1);
    const Nanos by = std::min(other.room, scaled(both, slowdown(*others, *its) - 1));
    if (by <= Nanos::zero()) continue;
    other.stretch *= to_s(other.ends - now + by) / to_s(other.ends - now);
    other.ends += by;
    other.room -= by;
    slowed_.push_back({other.executing.job, id, by});
  }
  unit.executing = execution;
  unit.noted = false;
  unit.ends = now + alone + more;
  unit.stretch = alone > Nanos::zero() ? to_s(alone + more) / to_s(alone) : 1;
  unit.room = most - more;
}

CallEffects::Rest CallEffects::suspend(UnitId id, Nanos now) {
  Unit& unit = units_[id];
  const Nanos takes = unit.ends - now;
  const Rest rest{unit.executing, takes, scaled(takes, 1 / unit.stretch)};
  unit.ends = now;
  unit.executing.conditions = nullptr;
  return rest;
}

CallEffects::Resumed CallEffects::resume(UnitId id, const Rest& rest, Nanos now,
                                         std::uint64_t random) {
  Unit& unit = units_[id];
  const UnitConditions& known = scenario_.services.units[id];
  // Handing over what was let in, which is part of leaving, has been counted.
  const Nanos handed = handover(known.handovers, Nanos::zero(), random);
  const Nanos passes =
      known.leave ? std::max(Nanos::zero(), known.leave->draw(random) - handed) : handed;
  slowed_.clear();
  if (rest.executing.conditions == nullptr) return {.passes = passes};
  run(rest.executing, rest.alone, now);
  const double part = rest.takes > Nanos::zero() ? to_s(unit.ends - now) / to_s(rest.takes) : 1;
  unit.ends += passes;
  return {.passes = passes, .part = part};
}

void CallEffects::ended(UnitId id, WorkloadId workload, JobIndex job, Nanos now) {
  Unit& unit = units_[id];
  if (--unit.tasks == 0) unit.idle_since = now;
  if (unit.executing.job != job) {  // Another one has begun, beside it or behind it.
    if (auto& its = unit.last[workload]) its->at = std::max(its->at, now);
    return;
  }
  note_touched(id, now);
  unit.ends = std::min(unit.ends, now);
}

}  // namespace pirt
