#include "reports/gate/table_gate.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <span>

#include "characterize/machine/environment_keys.h"
#include "characterize/statistics/rank_tests.h"
#include "reports/gate/between_runs.h"
#include "reports/gate/common_movement.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

std::string phase_name(const PhaseRow& row) {
  std::string name(to_string(row.phase));
  if (row.state != State::kSteady) name += " " + std::string(to_string(row.state));
  return name;
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

/// Why the two rows cannot be compared; empty if they can.
std::string complaint(const ProfileDiff& diff, const PhasePair& pair) {
  const PhaseRow& base = *pair.a;
  const PhaseRow& candidate = *pair.b;
  std::string identity = identity_complaint(diff, base.unit);
  if (!identity.empty()) return identity;
  for (const auto& [row, whose] : {std::pair(&base, "base"), std::pair(&candidate, "candidate")}) {
    if (is_valid(*row)) continue;
    return fmt::format("the {}'s row is {}: {}", whose, is_used(*row) ? "uncertain" : "invalid",
                       join(held_against(*row), ", "));
  }
  if (base.ops != candidate.ops || base.bytes != candidate.bytes)
    return "the workload is of another size";
  if (base.provenance != candidate.provenance) {
    return fmt::format("times are {} and {}", to_string(base.provenance),
                       to_string(candidate.provenance));
  }
  return "";
}

/// Whether one sample a side is all there is to know.
bool repeats(const PhasePair& pair) {
  return pair.a->is_deterministic() && pair.b->is_deterministic();
}

/// What repeats exactly has moved if it is not the same to the nanosecond.
void compare_counts(const PhasePair& pair, GateRow& row) {
  const Nanos more = *pair.b->median - *pair.a->median;
  row.verdict = more == Nanos(0)  ? GateVerdict::kSame
                : more > Nanos(0) ? GateVerdict::kSlower
                                  : GateVerdict::kFaster;
  row.needed = 0;
  if (more == Nanos(0)) return;
  row.reason = fmt::format("it repeats exactly, and is {} ns {}", std::abs(more.count()),
                           more > Nanos(0) ? "more" : "less");
}

struct Judged {
  GateRow* row = nullptr;
  Family family;
};

std::vector<Nanos> shifted(std::span<const Nanos> values, double shift) {
  std::vector<Nanos> result;
  for (const Nanos value : values) result.push_back(scaled(value, std::exp(shift)));
  return result;
}

/// Change of this row that makes the base's call longer by thresholds.of_call; 0 for rows that are
/// no part of a call.
double change_that_matters(const ProfileDiff& diff, const PhaseRow& base,
                           const GateThresholds& thresholds) {
  if (is_setup(base.phase) || base.phase == Phase::kCall) return 0;
  const PhaseRow* const call = diff.a->find(base.workload, base.unit, Phase::kCall);
  if (call == nullptr || !call->median || !base.median || base.median->count() <= 0) return 0;
  return thresholds.of_call * static_cast<double>(call->median->count()) /
         static_cast<double>(base.median->count());
}

GateRow compare(const ProfileDiff& diff, const PhasePair& pair, const CommonMovement& movement,
                const GateThresholds& thresholds) {
  const PhaseRow& base = *pair.a;
  const PhaseRow& candidate = *pair.b;
  GateRow row;
  row.workload = base.workload;
  row.unit = base.unit;
  row.phase = phase_name(base);
  if (base.median) row.base = static_cast<double>(base.median->count());
  if (candidate.median) row.candidate = static_cast<double>(candidate.median->count());
  if (!base.unknown().empty() && base.unknown() == candidate.unknown()) {
    row.verdict = GateVerdict::kNotJudged;
    row.reason = "unknown on both sides: " + base.unknown();
    return row;
  }
  row.reason = complaint(diff, pair);
  if (!row.reason.empty()) {
    row.verdict = GateVerdict::kNotComparable;
    return row;
  }
  row.ratio = pair.ratio();
  if (repeats(pair)) {
    compare_counts(pair, row);
    return row;
  }
  const std::size_t fewest = std::min(base.values.size(), candidate.values.size());
  if (fewest < thresholds.samples || !row.ratio) {
    row.verdict = GateVerdict::kNotJudged;
    row.reason = fmt::format("{} samples, {} are needed", fewest, thresholds.samples);
    return row;
  }
  const ExpectedMovement expected = movement.expected(pair);
  row.change = change_between(base, candidate, expected.shift);
  if (!row.change) {
    row.verdict = GateVerdict::kNotJudged;
    row.reason = "shorter than the clock can tell";
    return row;
  }
  if (const auto half = half_width_between(base, candidate)) {
    row.at_most = *row.ratio * std::exp(-expected.shift) * (1 + *half) - 1;
  }
  row.noise = noise_between(base, candidate, expected.drift);
  if (row.noise) row.noise = std::hypot(*row.noise, expected.sd);
  row.needed = std::max(thresholds.effect, change_that_matters(diff, base, thresholds));
  const auto values = shifted(base.values, expected.shift);
  row.p = *row.change > 0 ? mann_whitney_p(values, candidate.values)
                          : mann_whitney_p(candidate.values, values);
  return row;
}

/// Energy has one figure a cell and no samples to test: only what a meter read is judged. Modelled
/// joules follow from times that are judged themselves.
GateRow compare_energy(const ProfileDiff& diff, const EnergyPair& pair) {
  GateRow row;
  row.workload = pair.a->workload;
  row.unit = pair.a->unit;
  row.phase = "energy";
  row.base = pair.a->energy_j;
  row.candidate = pair.b->energy_j;
  const bool modelled = pair.a->provenance.provenance != Provenance::kMeasured;
  if (modelled && !row.base && !row.candidate && pair.a->reasons == pair.b->reasons) {
    row.verdict = GateVerdict::kNotJudged;
    row.reason = "unknown on both sides: " + join(pair.a->reasons, ", ");
    return row;
  }
  row.reason = identity_complaint(diff, row.unit);
  if (row.reason.empty() && (!is_valid(*pair.a) || !is_valid(*pair.b)))
    row.reason = "an energy row is invalid or uncertain";
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
  row.change = *row.ratio - 1;
  return row;
}

/// A row's own estimate comes from few processes and may be small by luck; that of a typical row of
/// its family stands below it.
std::map<Family, double> typical_noise(const std::vector<Judged>& rows) {
  std::map<Family, std::vector<double>> all;
  for (const auto& [row, family] : rows) {
    if (row->noise) all[family].push_back(*row->noise);
  }
  std::map<Family, double> typical;
  for (const auto& [family, values] : all) typical[family] = median_of(values);
  return typical;
}

/// Slower and faster are a family of tests each; who went the other way counts in it with p = 1.
void adjust(const std::vector<Judged>& rows) {
  for (const bool slower : {true, false}) {
    std::vector<double> p_values;
    for (const auto& [row, family] : rows) {
      p_values.push_back((*row->change > 0) == slower ? *row->p : 1);
    }
    const auto adjusted = holm_adjusted(p_values);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if ((*rows[i].row->change > 0) == slower) rows[i].row->p = adjusted[i];
    }
  }
}

/// A change that is not chance: beyond the noise between runs, nearly, or neither.
void weigh(double log_change, double matters, const GateThresholds& thresholds, GateRow& row) {
  const double change = std::expm1(std::abs(log_change));
  if (change >= *row.needed) {
    row.verdict = log_change > 0 ? GateVerdict::kSlower : GateVerdict::kFaster;
  } else if (log_change > 0 && change >= std::max(matters, thresholds.doubt * *row.needed)) {
    row.verdict = GateVerdict::kInconclusive;
    row.reason = fmt::format(
        "{:.1f} % more, but runs of one program differ by {:.1f} % here, so that {:.1f} % count; "
        "measure again",
        100 * change, 100 * *row.noise, 100 * *row.needed);
  }
}

/// For a row that is not known to have moved: whether it is known not to have.
void leave_open(GateRow& row, double matters) {
  if (row.verdict != GateVerdict::kSame) return;
  if (row.at_most && *row.at_most < matters) return;
  row.verdict = GateVerdict::kCannotTell;
  row.reason =
      row.at_most
          ? fmt::format(
                "may be slower by up to {:.1f} %, where {:.1f} % matter; more processes tell",
                100 * *row.at_most, 100 * matters)
          : "too few processes to say how far it may have moved";
}

void conclude(GateRow& row, double floor, const GateThresholds& thresholds) {
  const double log_change = *row.change;
  row.change = std::expm1(log_change);
  row.noise = std::max(row.noise.value_or(0), floor);
  const double matters = *row.needed;
  row.needed = std::max(matters, thresholds.noise_factor * *row.noise);
  if (*row.p < thresholds.alpha) weigh(log_change, matters, thresholds, row);
  leave_open(row, matters);
}

/// Only a rise of twice the effect counts, and of noise_factor times what metered rows of the unit
/// differ by between these two runs: meters have noise of their own, which no sample of time shows.
/// Most programs are as they were, so that the rows' spread around their middle is that noise.
void conclude_energy(const std::vector<GateRow*>& rows, const GateThresholds& thresholds) {
  std::map<std::string, std::vector<double>> ratios;
  for (const GateRow* row : rows) ratios[row->unit].push_back(*row->ratio);
  for (GateRow* row : rows) {
    const auto& of_unit = ratios[row->unit];
    const double matters = 2 * thresholds.effect;
    if (of_unit.size() >= thresholds.workloads) row->noise = process_spread(of_unit);
    row->needed = std::max(matters, thresholds.noise_factor * row->noise.value_or(0));
    const double log_change = std::log(*row->ratio);
    weigh(log_change, matters, thresholds, *row);
    if (!row->noise) continue;  // one figure, and nothing says how far it may be off
    constexpr double kOf95Percent = 1.96;
    row->at_most = std::expm1(log_change + kOf95Percent * *row->noise);
    leave_open(*row, matters);
  }
}

/// "; no program changes the f32 peak (-5.6 %) and memory bandwidth (-27.0 %) of cpu": what both
/// sides measured of these; empty if neither.
std::string witness(const ProfileDiff& diff, const std::vector<std::string>& units) {
  std::string text;
  for (const auto& unit : units) {
    std::vector<std::string> moved;
    for (const auto& [kind, name] : {std::pair{PeakKind::kF32, "f32 peak"},
                                     std::pair{PeakKind::kBandwidthMemory, "memory bandwidth"}}) {
      const PeakRow* a = diff.a->find_peak(unit, kind);
      const PeakRow* b = diff.b->find_peak(unit, kind);
      if (a == nullptr || b == nullptr || !a->per_second || !b->per_second) continue;
      moved.push_back(
          fmt::format("{} ({:+.1f} %)", name, 100 * (*b->per_second / *a->per_second - 1)));
    }
    if (moved.empty()) continue;
    text += fmt::format("; no program changes the {} of {}", join(moved, " and "), unit);
  }
  return text;
}

/// "all of cpu is", "the rows of cpu and opencl that vary most while a process runs are".
std::string subject(const JointMovement& moved) {
  const std::string units = join(moved.units, " and ");
  if (moved.rows == JointMovement::Rows::kUnsteady) {
    return "the rows of " + units + " that vary most while a process runs are";
  }
  return "all of " + units + " is";
}

/// One row for all that rows moved by together, where that is more than counts in one.
void add_movements(const ProfileDiff& diff, const std::vector<JointMovement>& movements,
                   const GateThresholds& thresholds, std::vector<GateRow>& rows) {
  for (const auto& moved : movements) {
    const double needed = std::max(thresholds.together, thresholds.noise_factor * moved.noise);
    if (std::expm1(std::abs(moved.shift)) < needed) continue;
    GateRow row;
    row.workload = "all";
    row.unit = join(moved.units, "+");
    row.phase = to_string(moved.rows);
    row.ratio = std::exp(moved.shift);
    row.change = *row.ratio - 1;
    row.noise = moved.noise;
    row.needed = needed;
    row.verdict = moved.shift > 0 ? GateVerdict::kInconclusive : GateVerdict::kFaster;
    if (moved.shift > 0) {
      row.reason = fmt::format(
          "{} {:.1f} % slower: the machine, or a change to everything{}; compare the two programs "
          "side by side: --baseline-program",
          subject(moved), 100 * (*row.ratio - 1), witness(diff, moved.units));
    }
    rows.push_back(std::move(row));
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
    case GateVerdict::kCannotTell:
      return "cannot tell";
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

GateResult judge(const ProfileDiff& diff, const GateThresholds& thresholds) {
  GateResult result;
  result.identity = diff.identity;
  CommonMovement::Pairs comparable;
  for (const auto& pair : diff.phases) {
    if (complaint(diff, pair).empty() && !repeats(pair)) comparable.push_back(&pair);
  }
  const CommonMovement movement(*diff.a, comparable, thresholds.workloads);
  for (const auto& pair : diff.phases) {
    result.rows.push_back(compare(diff, pair, movement, thresholds));
  }
  std::vector<Judged> judged;
  for (std::size_t i = 0; i < result.rows.size(); ++i) {
    if (result.rows[i].p) judged.push_back({&result.rows[i], family_of(diff.phases[i])});
  }
  adjust(judged);
  const auto typical = typical_noise(judged);
  for (const auto& [row, family] : judged) {
    const auto floor = typical.find(family);
    conclude(*row, floor == typical.end() ? 0 : floor->second, thresholds);
  }
  add_movements(diff, movement.all(), thresholds, result.rows);
  const auto times = result.rows.size();
  for (const auto& pair : diff.energies) result.rows.push_back(compare_energy(diff, pair));
  std::vector<GateRow*> metered;
  for (std::size_t i = times; i < result.rows.size(); ++i) {
    if (result.rows[i].change) metered.push_back(&result.rows[i]);
  }
  conclude_energy(metered, thresholds);
  add_missing(diff, result.rows);
  return result;
}

}  // namespace pirt
