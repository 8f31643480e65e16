#include "reports/gate/common_movement.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include "characterize/statistics/rank_tests.h"

namespace pirt {
namespace {

/// Of what a row is expected to move by for its excess: standard deviation of what it then does.
/// Found by what 66 runs of one machine, in hours of different noise, differ by
/// (tests/bench/README.md), as are the next two.
constexpr double kDoubtInFactor = 0.4;

/// As kDrift, of what many rows move by together: measured 0.4 to 0.7 within an hour.
constexpr double kDriftTogether = 0.6;

/// More than this many times their excess rows do not move from one hour to another. A bound, so
/// that a change to all rows that wander is not taken for the machine where they wander little.
constexpr double kGreatestFactor = 10;

struct Weighted {
  double value = 0, weight = 0;
};

/// @param values  At least one, of weight above 0.
double weighted_median(std::vector<Weighted> values) {
  std::ranges::sort(values, {}, &Weighted::value);
  double half = 0;
  for (const auto& each : values) half += each.weight / 2;
  double sum = 0;
  for (const auto& each : values) {
    sum += each.weight;
    if (sum >= half) return each.value;
  }
  return values.back().value;
}

bool may_wander(const PhaseRow& row) {
  return row.phase == Phase::kExecute || row.phase == Phase::kCall;
}

/// What an `execute` row that wanders in excess tells of those that share a memory.
struct Testimony {
  std::string workload;
  double moved = 0;  ///< Logarithm of candidate over base, without what all of its family moved by.
  double excess = 0;  ///< Above 0.
  double spread = 0;  ///< Of its processes.
};

struct Memory {
  std::set<std::string> units, workloads;
  std::vector<Testimony> testimonies;
};

/// Units that compute on the host share its memory, and with it what others take of that.
std::string memory_of(const Profile& profile, const std::string& unit) {
  const UnitRecord* const record = profile.find_unit(unit);
  return record != nullptr && record->device_is_cpu ? "" : unit;
}

/// Of all workloads but one. Absent if there are too few.
std::optional<double> factor_without(const std::string& workload,
                                     const std::vector<Testimony>& testimonies,
                                     std::size_t workloads) {
  std::vector<Weighted> factors;
  std::set<std::string> told;
  for (const auto& each : testimonies) {
    if (each.workload == workload) continue;
    factors.push_back({each.moved / each.excess, each.excess});
    told.insert(each.workload);
  }
  if (told.size() < workloads) return std::nullopt;
  return std::clamp(weighted_median(std::move(factors)), -kGreatestFactor, kGreatestFactor);
}

/// The median, rows that wander more counting more. @param testimonies  At least one.
double typical(const std::vector<Testimony>& testimonies, double Testimony::*member) {
  std::vector<Weighted> values;
  for (const auto& each : testimonies) values.push_back({each.*member, each.excess});
  return weighted_median(std::move(values));
}

}  // namespace

std::string_view to_string(JointMovement::Rows rows) {
  switch (rows) {
    case JointMovement::Rows::kRunning:
      return "running";
    case JointMovement::Rows::kSetup:
      return "set-up";
    case JointMovement::Rows::kUnsteady:
      return "unsteady";
  }
  return "";
}

Family family_of(const PhasePair& pair) { return {pair.a->unit, is_setup(pair.a->phase)}; }

CommonMovement::CommonMovement(const Profile& base, const Pairs& pairs, std::size_t workloads) {
  find_shifts(pairs, workloads);
  find_wanders(pairs);
  find_factors(base, pairs, workloads);
}

double CommonMovement::shift_of(const PhasePair& pair) const {
  const auto shift = shifts_.find(family_of(pair));
  return shift == shifts_.end() ? 0 : shift->second;
}

ExpectedMovement CommonMovement::expected(const PhasePair& pair) const {
  ExpectedMovement expected{.shift = shift_of(pair)};
  const auto factor = factors_.find({pair.a->unit, pair.a->workload});
  const auto wander = wanders_.find(pair.a);
  if (factor == factors_.end() || wander == wanders_.end()) return expected;
  const double moved = factor->second * wander->second.excess;
  expected.shift += moved;
  expected.sd = std::abs(kDoubtInFactor * moved);
  expected.drift = Drift::kOfOneRow;
  return expected;
}

/// The median of what the rows of a family changed by.
void CommonMovement::find_shifts(const Pairs& pairs, std::size_t workloads) {
  struct Rows {
    std::vector<double> changes, spreads;
    std::set<std::string> workloads;
  };
  std::map<Family, Rows> families;
  for (const PhasePair* pair : pairs) {
    const auto ratio = pair->ratio();
    if (!ratio || *ratio <= 0) continue;
    Rows& rows = families[family_of(*pair)];
    rows.changes.push_back(std::log(*ratio));
    rows.workloads.insert(pair->a->workload);
    if (const auto spread = spread_between(*pair->a, *pair->b)) rows.spreads.push_back(*spread);
  }
  for (const auto& [family, rows] : families) {
    if (rows.workloads.size() < workloads) continue;
    shifts_[family] = median_of(rows.changes);
    const double spread = rows.spreads.empty() ? 0 : median_of(rows.spreads);
    all_.push_back(
        {.units = {family.unit},
         .rows = family.setup ? JointMovement::Rows::kSetup : JointMovement::Rows::kRunning,
         .shift = shifts_[family],
         .noise = kDriftTogether * std::numbers::sqrt2 * spread});
  }
}

void CommonMovement::find_wanders(const Pairs& pairs) {
  std::map<std::string, std::vector<double>> of_unit;
  for (const PhasePair* pair : pairs) {
    if (!may_wander(*pair->a)) continue;
    const auto a = wander_of(*pair->a);
    const auto b = wander_of(*pair->b);
    if (!a || !b) continue;
    wanders_[pair->a] = {.mean = (*a + *b) / 2};
    of_unit[pair->a->unit].push_back((*a + *b) / 2);
  }
  for (auto& [row, wander] : wanders_) {
    wander.excess = std::max(0.0, wander.mean - median_of(of_unit[row->unit]));
  }
}

void CommonMovement::find_factors(const Profile& base, const Pairs& pairs, std::size_t workloads) {
  std::map<std::string, Memory> memories;
  for (const PhasePair* pair : pairs) {
    const PhaseRow& row = *pair->a;
    const auto wander = wanders_.find(&row);
    const auto ratio = pair->ratio();
    if (wander == wanders_.end() || !ratio || *ratio <= 0) continue;
    Memory& memory = memories[memory_of(base, row.unit)];
    memory.units.insert(row.unit);
    memory.workloads.insert(row.workload);
    if (row.phase != Phase::kExecute || wander->second.excess <= 0) continue;
    memory.testimonies.push_back({.workload = row.workload,
                                  .moved = std::log(*ratio) - shift_of(*pair),
                                  .excess = wander->second.excess,
                                  .spread = spread_between(row, *pair->b).value_or(0)});
  }
  for (const auto& [name, memory] : memories) {
    for (const auto& workload : memory.workloads) {
      const auto factor = factor_without(workload, memory.testimonies, workloads);
      if (!factor) continue;
      for (const auto& unit : memory.units) factors_[{unit, workload}] = *factor;
    }
    if (const auto factor = factor_without("", memory.testimonies, workloads)) {
      all_.push_back({.units = {memory.units.begin(), memory.units.end()},
                      .rows = JointMovement::Rows::kUnsteady,
                      .shift = *factor * typical(memory.testimonies, &Testimony::excess),
                      .noise = kDriftTogether * std::numbers::sqrt2 *
                               typical(memory.testimonies, &Testimony::spread)});
    }
  }
}

}  // namespace pirt
