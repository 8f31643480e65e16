#include "reports/gate/table_gate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "characterize/environment_keys.h"
#include "characterize/rank_tests.h"
#include "characterize/statistics.h"
#include "workloads/base/text.h"

namespace pirt {
namespace {

/// Expected range of k draws of a normal distribution, in standard deviations.
constexpr std::array<double, 11> kRangeOf = {0,     0,     1.128, 1.693, 2.059, 2.326,
                                             2.534, 2.704, 2.847, 2.970, 3.078};

std::string phase_name(const PhaseRow& row) {
  std::string name(to_string(row.phase));
  if (row.state != State::kSteady) name += " " + std::string(to_string(row.state));
  return name;
}

/// Relative; absent for one process. Of many, those in order of being taken ten at a time, since d2
/// ends there and a range of many is that of its worst.
std::optional<double> spread_of(const PhaseRow& row) {
  std::vector<double> medians;
  for (const Nanos each : process_medians(row.values, row.value_processes)) {
    medians.push_back(static_cast<double>(each.count()));
  }
  if (medians.size() < 2) return std::nullopt;
  const double middle = median_of(medians);
  if (middle <= 0) return std::nullopt;
  std::vector<double> spreads;
  const std::size_t groups = (medians.size() + 9) / 10;
  for (std::size_t g = 0; g < groups; ++g) {
    const std::size_t begin = g * medians.size() / groups;
    const std::size_t end = (g + 1) * medians.size() / groups;
    const auto [low, high] = std::ranges::minmax(std::span(medians).subspan(begin, end - begin));
    spreads.push_back((high - low) / kRangeOf[end - begin] / middle);
  }
  return median_of(spreads);
}

/// What of the identity differs for this unit; facts without a unit are of all.
std::string identity_complaint(const ProfileDiff& diff, const std::string& unit) {
  std::vector<std::string> parts;
  for (const auto& each : diff.identity) {
    const std::string of_unit = unit_of_key(each.fact);
    if (!of_unit.empty() && of_unit != unit) continue;
    parts.push_back(fmt::format("{} is {} and {}", each.fact, each.a.value_or("not there"),
                                each.b.value_or("not there")));
  }
  return join(parts, "; ");
}

std::string row_complaint(const PhaseRow& base, const PhaseRow& candidate) {
  if (!base.valid) return "the base's row is invalid: " + join(base.reasons, ", ");
  if (!candidate.valid) return "the candidate's row is invalid: " + join(candidate.reasons, ", ");
  if (base.ops != candidate.ops || base.bytes != candidate.bytes)
    return "the workload is of another size";
  if (base.provenance != candidate.provenance) {
    return fmt::format("times are {} and {}", to_string(base.provenance),
                       to_string(candidate.provenance));
  }
  return "";
}

GateRow compare(const ProfileDiff& diff, const PhasePair& pair, const GateThresholds& thresholds) {
  const PhaseRow& base = *pair.a;
  const PhaseRow& candidate = *pair.b;
  GateRow row;
  row.workload = base.workload;
  row.unit = base.unit;
  row.phase = phase_name(base);
  if (base.median) row.base = static_cast<double>(base.median->count());
  if (candidate.median) row.candidate = static_cast<double>(candidate.median->count());
  row.reason = identity_complaint(diff, base.unit);
  if (row.reason.empty()) row.reason = row_complaint(base, candidate);
  if (!row.reason.empty()) {
    row.verdict = GateVerdict::kNotComparable;
    return row;
  }
  row.ratio = pair.ratio();
  const std::size_t fewest = std::min(base.values.size(), candidate.values.size());
  if (fewest < thresholds.samples || !row.ratio) {
    row.verdict = GateVerdict::kNotJudged;
    row.reason = fmt::format("{} samples, {} are needed", fewest, thresholds.samples);
    return row;
  }
  const bool rose = *row.ratio >= 1;
  row.p = rose ? mann_whitney_p(base.values, candidate.values)
               : mann_whitney_p(candidate.values, base.values);
  row.noise = process_noise(base, candidate);
  return row;
}

/// Energy has one figure a cell and no samples to test: only what a meter read is judged, and only
/// a rise of twice the effect counts. Modelled joules follow from times that are judged themselves.
GateRow compare_energy(const ProfileDiff& diff, const EnergyPair& pair,
                       const GateThresholds& thresholds) {
  GateRow row;
  row.workload = pair.a->workload;
  row.unit = pair.a->unit;
  row.phase = "energy";
  row.base = pair.a->energy_j;
  row.candidate = pair.b->energy_j;
  row.reason = identity_complaint(diff, row.unit);
  if (row.reason.empty() && (!pair.a->valid || !pair.b->valid))
    row.reason = "an energy row is invalid";
  if (row.reason.empty() && pair.a->provenance != pair.b->provenance) {
    row.reason = fmt::format("energy is {} and {}", to_string(pair.a->provenance),
                             to_string(pair.b->provenance));
  }
  if (!row.reason.empty()) {
    row.verdict = GateVerdict::kNotComparable;
    return row;
  }
  row.ratio = pair.ratio();
  if (pair.a->provenance != Provenance::kMeasured || !row.ratio) {
    row.verdict = GateVerdict::kNotJudged;
    row.reason = fmt::format("{}, follows from the times", to_string(pair.a->provenance));
    return row;
  }
  row.needed = 2 * thresholds.effect;
  if (*row.ratio >= 1 + *row.needed) row.verdict = GateVerdict::kSlower;
  if (*row.ratio <= 1 / (1 + *row.needed)) row.verdict = GateVerdict::kFaster;
  return row;
}

/// A cell's own estimate comes from few processes and may be small by luck; that of a typical row
/// of the table stands below it.
double typical_noise(const std::vector<GateRow>& rows) {
  std::vector<double> all;
  for (const auto& row : rows) {
    if (row.noise) all.push_back(*row.noise);
  }
  return all.empty() ? 0 : median_of(all);
}

/// Slower and faster are a family of tests each; who went the other way counts in it with p = 1.
void adjust(std::vector<GateRow>& rows) {
  for (const bool slower : {true, false}) {
    std::vector<double> p_values;
    std::vector<GateRow*> judged;
    for (auto& row : rows) {
      if (!row.p) continue;
      const bool ours = (*row.ratio >= 1) == slower;
      p_values.push_back(ours ? *row.p : 1);
      judged.push_back(ours ? &row : nullptr);
    }
    const auto adjusted = holm_adjusted(p_values);
    for (std::size_t i = 0; i < judged.size(); ++i) {
      if (judged[i] != nullptr) judged[i]->p = adjusted[i];
    }
  }
}

void conclude(GateRow& row, double floor, const GateThresholds& thresholds) {
  row.noise = std::max(row.noise.value_or(0), floor);
  row.needed = std::max(thresholds.effect, thresholds.noise_factor * *row.noise);
  if (*row.p >= thresholds.alpha) return;
  const bool rose = *row.ratio >= 1;
  const double change = rose ? *row.ratio - 1 : 1 / *row.ratio - 1;
  if (change >= *row.needed) {
    row.verdict = rose ? GateVerdict::kSlower : GateVerdict::kFaster;
  } else if (rose && change >= thresholds.effect) {
    row.verdict = GateVerdict::kInconclusive;
    row.reason = fmt::format(
        "{:.1f} % slower, but processes of one program differ by {:.1f} % here; measure again",
        100 * change, 100 * *row.noise);
  }
}

void add_missing(const ProfileDiff& diff, std::vector<GateRow>& rows) {
  for (const auto& cell : diff.only_a) {
    GateRow row;
    const auto at = cell.find(" on ");
    row.workload = cell.substr(0, at);
    row.unit = at == std::string::npos ? "" : cell.substr(at + 4);
    row.phase = "all";
    row.verdict = GateVerdict::kNotComparable;
    row.reason = "the candidate has no such cell";
    rows.push_back(std::move(row));
  }
}

}  // namespace

std::string_view to_string(GateVerdict verdict) {
  switch (verdict) {
    case GateVerdict::kSame:
      return "same";
    case GateVerdict::kFaster:
      return "faster";
    case GateVerdict::kSlower:
      return "slower";
    case GateVerdict::kFailed:
      return "failed";
    case GateVerdict::kInconclusive:
      return "inconclusive";
    case GateVerdict::kNotComparable:
      return "not comparable";
    case GateVerdict::kNotJudged:
      return "not judged";
  }
  return "";
}

std::int64_t GateResult::count(GateVerdict verdict) const {
  return std::ranges::count(rows, verdict, &GateRow::verdict);
}

std::optional<double> process_noise(const PhaseRow& base, const PhaseRow& candidate) {
  const auto a = spread_of(base);
  const auto b = spread_of(candidate);
  if (a && b) return std::sqrt((*a * *a + *b * *b) / 2);
  return a ? a : b;
}

GateResult judge(const ProfileDiff& diff, const GateThresholds& thresholds) {
  GateResult result;
  result.identity = diff.identity;
  for (const auto& pair : diff.phases) result.rows.push_back(compare(diff, pair, thresholds));
  const double floor = typical_noise(result.rows);
  adjust(result.rows);
  for (auto& row : result.rows) {
    if (row.p) conclude(row, floor, thresholds);
  }
  for (const auto& pair : diff.energies)
    result.rows.push_back(compare_energy(diff, pair, thresholds));
  add_missing(diff, result.rows);
  return result;
}

}  // namespace pirt
