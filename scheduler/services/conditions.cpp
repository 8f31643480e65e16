#include "scheduler/services/conditions.h"

#include <algorithm>
#include <cstdlib>

#include "scheduler/services/services.h"

namespace pirt {
namespace {

const PhaseRow* usable(const PhaseRow* row, bool strict) {
  return row != nullptr && is_used(*row, strict) && row->median ? row : nullptr;
}

/// Which limit its roofline has: the time of its bytes from memory against that of its operations.
bool waits_for_memory(const Profile& profile, const PhaseRow& steady) {
  const PeakRow* memory = profile.find_peak(steady.unit, PeakKind::kBandwidthMemory);
  const PeakRow* f32 = profile.find_peak(steady.unit, PeakKind::kF32);
  const bool known = memory != nullptr && f32 != nullptr && is_used(*memory) && is_used(*f32) &&
                     memory->per_second && f32->per_second && steady.ops;
  if (!known) return false;
  return static_cast<double>(steady.bytes) / *memory->per_second >
         static_cast<double>(*steady.ops) / *f32->per_second;
}

/// What reading again after a while took, between reading at once and after a sweep. Nothing where
/// those two are as good as the same: then there is nothing to lose.
std::vector<UnitConditions::Forgotten> forgotten_by(const std::vector<const UnitTimeRow*>& after,
                                                    const UnitTimeRow* cold) {
  constexpr double kSame = 1.1;
  std::vector<UnitConditions::Forgotten> forgotten;
  if (cold == nullptr || after.empty() || after.front()->sleep != Nanos::zero()) return forgotten;
  const double at_once = to_s(*after.front()->median);
  const double lost = to_s(*cold->median) - at_once;
  if (lost <= (kSame - 1) * at_once) return forgotten;
  for (const UnitTimeRow* row : after) {
    forgotten.push_back({row->sleep, std::clamp((to_s(*row->median) - at_once) / lost, 0.0, 1.0)});
  }
  return forgotten;
}

/// Of the newest run that has it; 0 = none.
std::int64_t fact_of(const Profile& profile, const std::string& unit, std::string_view name) {
  const std::string fact = "unit." + unit + "." + std::string(name);
  for (const RunInfo& run : profile.runs) {
    const auto bytes = run.environment.find(fact);
    if (bytes != run.environment.end()) return std::strtoll(bytes->second.c_str(), nullptr, 10);
  }
  return 0;
}

}  // namespace

template <typename Row>
Nanos usual_worst_of(const Row& row) {
  const Nanos usual = row.p95.value_or(*row.median);
  return is_doubted(row) ? std::max(usual, row.ci_high.value_or(usual)) : usual;
}
template Nanos usual_worst_of(const PhaseRow& row);

template <typename Row>
Distribution time_of(const Row& row, Draw draw) {
  if (draw == Draw::kSamples) return Distribution::of(row.values);
  return Distribution::constant(draw == Draw::kP95 ? row.p95.value_or(*row.median) : *row.median);
}
template Distribution time_of(const PhaseRow& row, Draw draw);

std::optional<CallConditions> call_conditions(const Profile& profile, const std::string& workload,
                                              const std::string& unit, std::int64_t bytes,
                                              Draw draw, bool strict) {
  if (profile.conditions.empty()) return std::nullopt;
  const PhaseRow* steady = usable(profile.find(workload, unit, Phase::kExecute), strict);
  if (steady == nullptr || std::ranges::find(steady->notes, "live") != steady->notes.end()) {
    return std::nullopt;
  }
  const auto find = [&](Condition condition) {
    return usable(profile.find_condition(workload, unit, condition), strict);
  };
  const auto slowdown = [&](Condition condition) {
    const PhaseRow* row = find(condition);
    if (row == nullptr || *steady->median <= Nanos::zero()) return 1.0;
    return std::max(1.0, to_s(*row->median) / to_s(*steady->median));
  };
  CallConditions found;
  const auto drawn_of = [&](Condition condition) -> std::optional<Distribution> {
    const PhaseRow* row = find(condition);
    if (row == nullptr) return std::nullopt;
    found.usual_worst = std::max(found.usual_worst, usual_worst_of(*row));
    return time_of(*row, draw);
  };
  found.cold_cache = drawn_of(Condition::kColdCache);
  found.cold_memory = drawn_of(Condition::kColdMemory);
  found.beside_memory = slowdown(Condition::kBesideMemory);
  found.beside_compute = slowdown(Condition::kBesideCompute);
  found.bytes = bytes;
  found.streams = waits_for_memory(profile, *steady);
  return found;
}

UnitConditions unit_conditions(const Profile& profile, const UnitModel& unit, Draw draw,
                               bool strict) {
  UnitConditions found;
  std::vector<const UnitTimeRow*> rereads;
  const UnitTimeRow* cold = nullptr;
  for (const UnitTimeRow& row : profile.unit_times) {
    if (row.unit != unit.name || !is_used(row, strict) || !row.median) continue;
    if (row.phase == UnitPhase::kHandover) {
      if (found.handovers.empty() && !found.leave) found.longest_leave = usual_worst_of(row);
      found.handovers.push_back({row.sleep, time_of(row, draw)});
      found.longest_handover = std::max(found.longest_handover, usual_worst_of(row));
    } else if (row.phase == UnitPhase::kLeave) {
      found.leave = time_of(row, draw);
      found.longest_leave = usual_worst_of(row);
    } else if (row.phase == UnitPhase::kReread) {
      rereads.push_back(&row);
    } else if (row.phase == UnitPhase::kRereadCold) {
      cold = &row;
    }
  }
  found.forgotten = forgotten_by(rereads, cold);
  found.cache_bytes = fact_of(profile, unit.name, kOwnCacheBytes);
  found.last_cache_bytes = fact_of(profile, unit.name, kLastCacheBytes);
  return found;
}

}  // namespace pirt
