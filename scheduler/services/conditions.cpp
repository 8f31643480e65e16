#include "scheduler/services/conditions.h"

#include <algorithm>
#include <cstdlib>

#include "scheduler/services/services.h"

namespace pirt {
namespace {

Distribution drawn(Nanos median, Nanos p95, const std::vector<Nanos>& values, Draw draw) {
  switch (draw) {
    case Draw::kMedian:
      return Distribution::constant(median);
    case Draw::kP95:
      return Distribution::constant(p95);
    case Draw::kSamples:
      break;
  }
  return Distribution::of(values);
}

const PhaseRow* usable(const PhaseRow* row) {
  return row != nullptr && row->valid && row->median ? row : nullptr;
}

/// Which limit its roofline has: the time of its bytes from memory against that of its operations.
bool waits_for_memory(const Profile& profile, const PhaseRow& steady) {
  const PeakRow* memory = profile.find_peak(steady.unit, PeakKind::kBandwidthMemory);
  const PeakRow* f32 = profile.find_peak(steady.unit, PeakKind::kF32);
  const bool known =
      memory != nullptr && f32 != nullptr && memory->per_second && f32->per_second && steady.ops;
  if (!known) return false;
  return static_cast<double>(steady.bytes) / *memory->per_second >
         static_cast<double>(*steady.ops) / *f32->per_second;
}

}  // namespace

Distribution time_of(const PhaseRow& row, Draw draw) {
  return drawn(*row.median, *row.p95, row.values, draw);
}

std::optional<CallConditions> call_conditions(const Profile& profile, const std::string& workload,
                                              const std::string& unit, std::int64_t bytes,
                                              Draw draw) {
  if (profile.conditions.empty()) return std::nullopt;
  const PhaseRow* steady = usable(profile.find(workload, unit, Phase::kExecute));
  if (steady == nullptr || std::ranges::find(steady->notes, "live") != steady->notes.end()) {
    return std::nullopt;
  }
  const auto find = [&](Condition condition) {
    return usable(profile.find_condition(workload, unit, condition));
  };
  const auto slowdown = [&](Condition condition) {
    const PhaseRow* row = find(condition);
    if (row == nullptr || *steady->median <= Nanos::zero()) return 1.0;
    return std::max(1.0, to_s(*row->median) / to_s(*steady->median));
  };
  CallConditions found;
  if (const PhaseRow* cold = find(Condition::kColdCache)) found.cold = time_of(*cold, draw);
  found.beside_memory = slowdown(Condition::kBesideMemory);
  found.beside_compute = slowdown(Condition::kBesideCompute);
  found.bytes = bytes;
  found.streams = waits_for_memory(profile, *steady);
  return found;
}

UnitConditions unit_conditions(const Profile& profile, const UnitModel& unit, Draw draw) {
  UnitConditions found;
  found.memory = unit.memory;
  for (const HandoverRow& row : profile.handovers) {
    if (row.unit != unit.name || !row.valid || !row.median) continue;
    found.handovers.push_back({row.sleep, drawn(*row.median, *row.p95, row.values, draw)});
  }
  const std::string fact = "unit." + unit.name + "." + std::string(kOwnCacheBytes);
  for (const RunInfo& run : profile.runs) {
    const auto bytes = run.environment.find(fact);
    if (bytes == run.environment.end()) continue;
    found.cache_bytes = std::strtoll(bytes->second.c_str(), nullptr, 10);
    break;
  }
  return found;
}

}  // namespace pirt
