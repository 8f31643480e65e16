#include "reports/gate/table_gate.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "characterize/campaign/validity.h"
#include "characterize/profile/identity.h"
#include "characterize/statistics/rank_tests.h"
#include "reports/gate/tail.h"
#include "workloads/base/text/text.h"
#include "workloads/base/time.h"

namespace pirt {
namespace {

/// In what the runs of two rows of a unit differ; empty if the rows may be compared.
template <typename Row>
std::string identity_complaint(const ProfileDiff& diff, const Row& base, const Row& candidate) {
  return describe(compare_identity(*diff.a->find_run(base.run_id),
                                   *diff.b->find_run(candidate.run_id), base.unit));
}

/// Why the two rows cannot be compared; empty if they can.
std::string complaint(const ProfileDiff& diff, const PhasePair& pair) {
  const PhaseRow& base = *pair.a;
  const PhaseRow& candidate = *pair.b;
  std::string identity = identity_complaint(diff, base, candidate);
  if (!identity.empty()) return identity;
  for (const auto& [row, whose] : {std::pair(&base, "base"), std::pair(&candidate, "candidate")}) {
    if (is_used(*row)) continue;
    return fmt::format("the {}'s row is invalid: {}", whose, join(row->reasons, ", "));
  }
  return compare_work(base, candidate);
}

/// What nobody could measure, in both runs, is no change.
template <typename Row>
bool has_no_figure(const Row& base, const Row& candidate, GateRow& row) {
  if (is_used(base) || is_used(candidate)) return false;
  row.verdict = GateVerdict::kNotJudged;
  row.reason = "no figure on either side: " + join(candidate.reasons, ", ");
  return true;
}

/// A wrong output, or an error; empty if it has neither.
std::string failure_of(const PhaseRow& row) {
  for (const auto& reason : row.reasons) {
    if (reason == "wrong_output" || reason.starts_with("error: ")) return reason;
  }
  return "";
}

/// What the candidate did not get through comes first, whatever else is to be said. A cell that
/// failed in the base as well has not become worse.
bool fails(const PhaseRow& base, const PhaseRow& candidate, GateRow& row) {
  const std::string failure = failure_of(candidate);
  if (failure.empty()) return false;
  row.reason = failure;
  if (!failure_of(base).empty()) {
    row.verdict = GateVerdict::kUndecided;
    row.reason += "; the base failed, too";
  } else if (failure == "wrong_output" || candidate.failed_processes() >= 2) {
    row.verdict = GateVerdict::kFailed;
  } else {
    row.verdict = GateVerdict::kInconclusive;
    row.reason += "; in one process, measure again";
  }
  return true;
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

/// What a row may have moved by without a program's doing: logarithms of candidate over base.
struct Allowance {
  double slower = 0, faster = 0;  ///< At least 0, at most 0.
  double scatter = 0;             ///< Either way, of a row alone: by so much rows differ anyway.
  void add(double shift) {
    slower = std::max(slower, shift);
    faster = std::min(faster, shift);
  }
};

std::vector<std::int64_t> runs_of(const PhaseRow& row) {
  std::vector<std::int64_t> runs = row.pooled_runs;
  runs.push_back(row.run_id);
  return runs;
}
std::vector<std::int64_t> runs_of(const EnergyRow& row) { return {row.run_id}; }

/// The peak of a row's unit in the runs that the row is of.
template <typename Row>
std::optional<double> peak_of(const Profile& profile, const Row& row, PeakKind kind) {
  const auto runs = runs_of(row);
  std::vector<double> rates;
  for (const auto* peaks : {&profile.peaks, &profile.earlier_peaks}) {
    for (const PeakRow& each : *peaks) {
      const bool is_its_own = each.unit == row.unit && each.kind == kind &&
                              std::ranges::find(runs, each.run_id) != runs.end();
      if (is_its_own && is_used(each) && each.per_second) rates.push_back(*each.per_second);
    }
  }
  return rates.empty() ? std::nullopt : std::optional(median_of(rates));
}

/// What the unit's peaks changed by between the runs of the two rows.
template <typename Row>
std::vector<MachineShift> peak_shifts(const ProfileDiff& diff, const Row& base,
                                      const Row& candidate) {
  std::vector<MachineShift> shifts;
  for (const PeakKind kind : {PeakKind::kF32, PeakKind::kBandwidthMemory}) {
    const auto before = peak_of(*diff.a, base, kind);
    const auto after = peak_of(*diff.b, candidate, kind);
    if (before && after) shifts.push_back({base.unit, kind, *after / *before});
  }
  return shifts;
}

template <typename Row>
Allowance peaks_allowance(const ProfileDiff& diff, const Row& base, const Row& candidate) {
  Allowance allowed;
  for (const MachineShift& each : peak_shifts(diff, base, candidate)) {
    allowed.add(-std::log(each.ratio));
  }
  return allowed;
}

/// A median with its interval, in any unit; all above 0.
struct Estimate {
  double low = 0, middle = 0, high = 0;
};

std::optional<Estimate> estimate_of(const PhaseRow& row) {
  if (row.processes < kFewestProcesses) return std::nullopt;
  if (!row.median || !row.ci_low || row.ci_low->count() <= 0) return std::nullopt;
  return Estimate{to_s(*row.ci_low), to_s(*row.median), to_s(*row.ci_high)};
}

std::optional<Estimate> estimate_of(const EnergyRow& row) {
  if (!row.energy_j || !row.ci_low_j || !row.ci_high_j || *row.ci_low_j <= 0) return std::nullopt;
  return Estimate{*row.ci_low_j, *row.energy_j, *row.ci_high_j};
}

/// Doubts that no interval shows: its processes met another machine than others would.
std::string barred_by(const std::vector<std::string>& doubts) {
  for (const auto& doubt : doubts) {
    for (const char* word : {"unstable", "contended", "throttled"}) {
      if (doubt.starts_with(word)) return word;
    }
  }
  return "";
}

/// Why a row's change is no program's for sure; empty if it may be. A set-up is as doubted as the
/// calls of its cell: the same processes took both.
std::string doubt_of(const ProfileDiff& diff, const PhasePair& pair) {
  const PhaseRow& base = *pair.a;
  for (const auto& [profile, own, whose] :
       {std::tuple(diff.a, pair.a, "base"), std::tuple(diff.b, pair.b, "candidate")}) {
    const PhaseRow* const call = profile->find(own->workload, own->unit, Phase::kCall);
    for (const PhaseRow* row : {own, is_setup(base.phase) ? call : nullptr}) {
      const std::string word = row == nullptr ? "" : barred_by(row->doubts);
      if (!word.empty()) return fmt::format("the {}'s {} is {}", whose, row->phase_name(), word);
    }
  }
  return "";
}

/// @param allowed  What is the machine's, or may be.
/// @param doubt    Why nothing may be said for sure; empty if it may.
void weigh(const Estimate& base, const Estimate& candidate, const Allowance& allowed,
           const std::string& doubt, GateRow& row) {
  const double change = std::log(candidate.middle / base.middle);
  const double least = std::log(candidate.low / base.high);
  const double most = std::log(candidate.high / base.low);
  const double widths =
      std::hypot(std::log(candidate.high / candidate.middle), std::log(base.middle / base.low));
  row.change = std::expm1(change);
  row.at_least = std::expm1(least);
  row.at_most = std::expm1(change + widths);
  const double effect = std::log1p(*row.needed);
  const double half = std::log1p(*row.needed / 2);
  const bool slower = change - allowed.slower >= effect && least - allowed.slower >= half &&
                      change >= allowed.scatter;
  const bool faster = change - allowed.faster <= -effect && most - allowed.faster <= -half &&
                      change <= -allowed.scatter;
  if (doubt.empty() && slower) {
    row.verdict = GateVerdict::kSlower;
  } else if (doubt.empty() && faster) {
    row.verdict = GateVerdict::kFaster;
  } else if (doubt.empty() && change + widths - allowed.faster < half) {
    row.verdict = GateVerdict::kSame;
  } else {
    row.verdict = GateVerdict::kUndecided;
    row.reason =
        !doubt.empty() ? doubt
        : std::abs(change) < allowed.scatter && std::max(least, -most) > 0
            ? fmt::format(
                  "{:+.1f} %, where rows of the unit differ from run to run so that {:.1f} "
                  "% are nothing; measure where less else runs, or side by side: "
                  "--baseline-program",
                  percent_of(change), percent_of(allowed.scatter))
        : least > 0
            ? fmt::format(
                  "{:.1f} % more, where {:.1f} % count; up to {:.1f} % may be the machine's",
                  percent_of(change), 100 * *row.needed, percent_of(allowed.slower))
            : fmt::format(
                  "may be slower by up to {:.1f} %, where {:.1f} % matter; more processes "
                  "tell",
                  percent_of(change + widths - allowed.faster), 50 * *row.needed);
  }
}

/// Change of a row that counts as slower.
double change_needed(const ProfileDiff& diff, const PhaseRow& base,
                     const GateThresholds& thresholds) {
  const auto share_of = [&base](Nanos part) { return to_s(part) / to_s(*base.median); };
  if (is_setup(base.phase)) {
    return std::max(thresholds.setup * thresholds.effect, share_of(thresholds.setup_grain));
  }
  const PhaseRow* const call = diff.a->find(base.workload, base.unit, Phase::kCall);
  if (base.phase == Phase::kCall || call == nullptr || !call->median) return thresholds.effect;
  return std::max(thresholds.effect,
                  thresholds.of_call * thresholds.effect * share_of(*call->median));
}

/// Rows that a machine moves alike: a unit's set-up, and its others.
using Family = std::pair<std::string, bool>;
Family family_of(const PhaseRow& row) { return {row.unit, is_setup(row.phase)}; }
Family family_of(const EnergyRow& row) { return {row.unit, false}; }

/// What the rows of a family changed by: logarithms.
struct Changes {
  std::set<std::string> workloads;
  std::vector<double> all;
  std::vector<double> slower, faster;  ///< Beyond what each row's peaks allow.
};

/// The newest run of @p candidate after @p run_id that was to measure the cell, and has not; null
/// if there is none.
const RunInfo* lost_by(const Profile& candidate, const CellName& cell, std::int64_t run_id) {
  const RunInfo* run = nullptr;
  for (const RunInfo& each : candidate.runs) {
    if (each.run_id <= run_id) continue;
    if (std::ranges::find(each.planned, cell) == each.planned.end()) continue;
    run_id = each.run_id;
    run = &each;
  }
  return run;
}

/// Of a row of the candidate, which is then of another program than the one that is judged.
template <typename Row>
const RunInfo* lost_by(const ProfileDiff& diff, const Row& row) {
  return lost_by(*diff.b, {row.workload, row.unit}, row.run_id);
}

/// What the machine moved by, and what families of rows moved by together.
class Movements {
 public:
  Movements(const ProfileDiff& diff, const GateThresholds& thresholds) : diff_(diff) {
    std::map<Family, Changes> changes;
    for (const PhasePair& pair : diff.phases) {
      if (lost_by(diff, *pair.b) != nullptr) continue;
      add_peaks(pair);
      const auto ratio = pair.ratio();
      if (!ratio || *ratio <= 0 || repeats(pair) || !complaint(diff, pair).empty()) continue;
      if (!doubt_of(diff, pair).empty()) continue;
      if (!estimate_of(*pair.a) || !estimate_of(*pair.b)) continue;
      const double change = std::log(*ratio);
      const Allowance peaks = peaks_allowance(diff, *pair.a, *pair.b);
      Changes& of_family = changes[family_of(*pair.a)];
      of_family.workloads.insert(pair.a->workload);
      of_family.all.push_back(change);
      of_family.slower.push_back(change - peaks.slower);
      of_family.faster.push_back(change - peaks.faster);
    }
    for (auto& [family, moved] : changes) {
      if (moved.workloads.size() < thresholds.workloads) continue;
      for (auto* each : {&moved.all, &moved.slower, &moved.faster}) std::ranges::sort(*each);
      add_scatter(family, moved.all, thresholds);
      add_together(family, moved, thresholds);
    }
  }

  template <typename Row>
  [[nodiscard]] Allowance allowance_for(const Row& base, const Row& candidate) const {
    const Family family = family_of(base);
    Allowance allowed = peaks_allowance(diff_, base, candidate);
    const auto scatter = scatter_.find(family);
    if (scatter != scatter_.end()) allowed.scatter = scatter->second;
    const auto together = together_.find(family);
    if (together != together_.end()) allowed.add(together->second);
    return allowed;
  }
  /// Whether there are rows enough to tell how far they differ from run to run.
  [[nodiscard]] bool knows_scatter(const Family& family) const { return scatter_.contains(family); }
  [[nodiscard]] const std::vector<MachineShift>& machine() const { return machine_; }
  [[nodiscard]] const std::vector<GateRow>& rows() const { return rows_; }

 private:
  void add_peaks(const PhasePair& pair) {
    if (!identity_complaint(diff_, *pair.a, *pair.b).empty()) return;
    for (MachineShift& each : peak_shifts(diff_, *pair.a, *pair.b)) {
      const bool is_known = std::ranges::find(machine_, each) != machine_.end();
      if (!is_known) machine_.push_back(std::move(each));
    }
  }

  /// An interval over the processes of one run knows nothing of what the machine will be like in
  /// another one. Rows that nobody changed do: by the narrowest range that holds half of all, which
  /// those that were changed do not widen.
  /// @param moved  Sorted.
  /// @source  The shorth: Rousseeuw and Leroy, A robust scale estimator based on the shortest half,
  /// Statistica Neerlandica 42, 1988.
  void add_scatter(const Family& family, const std::vector<double>& moved,
                   const GateThresholds& thresholds) {
    constexpr double kOfNormal = 1.4826;  // The standard deviation of normal values, of half of it.
    const std::size_t half = moved.size() / 2;
    double narrowest = moved.back() - moved.front();
    for (std::size_t i = 0; i + half < moved.size(); ++i) {
      narrowest = std::min(narrowest, moved[i + half] - moved[i]);
    }
    scatter_[family] = thresholds.scatter * kOfNormal * narrowest / 2;
  }

  /// What three quarters of the rows moved by at least, beyond the peaks.
  /// @param moved  Each sorted.
  void add_together(const Family& family, const Changes& moved, const GateThresholds& thresholds) {
    const std::size_t quarter = moved.all.size() / 4;
    const std::size_t last_quarter = moved.all.size() - 1 - quarter;
    const double needed =
        std::log1p(thresholds.together * (family.second ? thresholds.setup : 1.0));
    const bool slower = moved.slower[quarter] >= needed;
    if (!slower && moved.faster[last_quarter] > -needed) return;
    const double shift = moved.all[slower ? quarter : last_quarter];
    together_[family] = shift;
    GateRow row{.workload = "all",
                .unit = family.first,
                .phase = family.second ? "set-up" : "running",
                .setup = family.second,
                .verdict = slower ? GateVerdict::kInconclusive : GateVerdict::kFaster,
                .ratio = std::exp(shift),
                .change = std::expm1(shift),
                .needed = std::expm1(needed)};
    if (slower) {
      row.reason = fmt::format(
          "all rows moved together, by {:.1f} % or more, {:.1f} % with the unit's peaks: the "
          "machine's or the program's, it cannot be told; compare the two programs side by side: "
          "--baseline-program",
          percent_of(shift), percent_of(shift - moved.slower[quarter]));
    }
    rows_.push_back(std::move(row));
  }

  const ProfileDiff& diff_;
  std::vector<MachineShift> machine_;
  std::map<Family, double> together_, scatter_;
  std::vector<GateRow> rows_;
};

/// Whether @p run, which is lost_by's, has lost the row's cell if it ended, or else did not get
/// there.
bool is_lost(const RunInfo* run, GateRow& row) {
  if (run == nullptr) return false;
  const bool ended = !run->finished.empty();
  row.verdict = ended ? GateVerdict::kFailed : GateVerdict::kNotComparable;
  row.reason = ended ? "the candidate's plan has it, and its newest run has not"
                     : "the candidate's run did not end; go on with: pirt characterize --resume";
  return true;
}

GateRow compare(const ProfileDiff& diff, const PhasePair& pair, const Movements& movements,
                const GateThresholds& thresholds) {
  const PhaseRow& base = *pair.a;
  const PhaseRow& candidate = *pair.b;
  GateRow row{.workload = base.workload,
              .unit = base.unit,
              .phase = base.phase_name(),
              .setup = is_setup(base.phase)};
  if (base.median) row.base = static_cast<double>(base.median->count());
  if (candidate.median) row.candidate = static_cast<double>(candidate.median->count());
  if (fails(base, candidate, row)) return row;
  if (is_lost(lost_by(diff, candidate), row)) return row;
  if (failure_of(base).empty() && has_no_figure(base, candidate, row)) return row;
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
  const auto of_base = estimate_of(base);
  const auto of_candidate = estimate_of(candidate);
  if (!of_base || !of_candidate) {
    // Of calls something is known, and not enough; a set-up has as few processes as it was given.
    const bool too_short = base.median == Nanos(0);
    row.verdict = row.setup || too_short ? GateVerdict::kNotJudged : GateVerdict::kUndecided;
    row.reason = too_short ? "shorter than the clock can tell"
                           : fmt::format("too few processes for an interval; {} are needed",
                                         kFewestProcesses);
    return row;
  }
  row.needed = change_needed(diff, base, thresholds);
  weigh(*of_base, *of_candidate, movements.allowance_for(base, candidate), doubt_of(diff, pair),
        row);
  if (row.verdict != GateVerdict::kSlower &&
      candidate.failed_processes() > base.failed_processes()) {
    row.verdict = GateVerdict::kUndecided;
    row.reason = "a process of the candidate failed; measure again";
  }
  return row;
}

/// Only what a meter read is judged: modelled joules follow from times that are judged themselves.
/// What the machine moved the unit's calls by it may have moved their energy by.
GateRow compare_energy(const ProfileDiff& diff, const EnergyPair& pair, const Movements& movements,
                       const GateThresholds& thresholds) {
  GateRow row{.workload = pair.a->workload,
              .unit = pair.a->unit,
              .phase = "energy",
              .measure = "J",
              .base = pair.a->energy_j,
              .candidate = pair.b->energy_j};
  row.verdict = GateVerdict::kNotJudged;
  if (pair.a->provenance != Provenance::kMeasured && pair.a->provenance == pair.b->provenance) {
    row.reason = fmt::format("{}, follows from the times", to_string(pair.a->provenance));
    return row;
  }
  const RunInfo* const newer = lost_by(diff, *pair.b);
  const bool has_times = std::ranges::any_of(diff.b->phases, [&](const PhaseRow& each) {
    return newer != nullptr && each.run_id == newer->run_id && each.workload == pair.b->workload &&
           each.unit == pair.b->unit;
  });
  if (has_times) {
    row.reason = "the candidate's newest run has no joules of it";
    return row;
  }
  if (is_lost(newer, row)) return row;
  if (has_no_figure(*pair.a, *pair.b, row)) return row;
  row.reason = identity_complaint(diff, *pair.a, *pair.b);
  if (row.reason.empty() && pair.a->provenance != pair.b->provenance) {
    row.reason = fmt::format("energy is {} and {}", to_string(pair.a->provenance),
                             to_string(pair.b->provenance));
  }
  if (row.reason.empty() &&
      (pair.a->domain != pair.b->domain || pair.a->idle_subtracted != pair.b->idle_subtracted)) {
    row.reason = "the meters cover something else";
  }
  if (!row.reason.empty()) {
    row.verdict = GateVerdict::kNotComparable;
    return row;
  }
  for (const auto& [energy, whose] : {std::pair(pair.a, "base"), std::pair(pair.b, "candidate")}) {
    if (is_used(*energy)) continue;
    row.verdict = GateVerdict::kUndecided;
    row.reason = fmt::format("the {} has no figure: {}", whose, join(energy->reasons, ", "));
    return row;
  }
  row.ratio = pair.ratio();
  const auto base = estimate_of(*pair.a);
  const auto candidate = estimate_of(*pair.b);
  if (!base || !candidate) {
    row.reason = "the meter's figure has no interval";
    return row;
  }
  row.needed = thresholds.effect;
  std::string doubt;
  for (const EnergyRow* each : {pair.a, pair.b}) {
    if (doubt.empty()) doubt = barred_by(each->doubts);
    const bool beside = each->source.find("; contended") != std::string::npos;
    if (doubt.empty() && beside) doubt = "contended";
  }
  weigh(*base, *candidate, movements.allowance_for(*pair.a, *pair.b),
        doubt.empty() ? "" : "an energy row is " + doubt, row);
  return row;
}

/// A cell that only the candidate has: it has nothing to be compared with, and may fail.
void judge_new(const Profile& candidate, GateRow& row) {
  std::string failure;
  int failed = 0;
  for (const PhaseRow& each : candidate.phases) {
    if (each.workload != row.workload || each.unit != row.unit) continue;
    if (failure.empty()) failure = failure_of(each);
    failed = std::max(failed, each.failed_processes());
  }
  row.verdict = failure.empty()                            ? GateVerdict::kNotJudged
                : failure == "wrong_output" || failed >= 2 ? GateVerdict::kFailed
                                                           : GateVerdict::kInconclusive;
  row.reason = (failure.empty() ? "" : failure + "; ") + "only the candidate has it";
  row.is_new = true;
}

/// Cells of one profile that the other lacks, and phases of cells that both have.
void add_missing(const ProfileDiff& diff, std::vector<GateRow>& rows) {
  std::set<std::pair<std::string, std::string>> told;
  for (const auto* profile : {diff.a, diff.b}) {
    const bool of_base = profile == diff.a;
    const Profile& other = of_base ? *diff.b : *diff.a;
    for (const PhaseRow& row : profile->phases) {
      if (other.find(row.workload, row.unit, row.phase, row.state) != nullptr) continue;
      const bool has_cell = std::ranges::any_of(other.phases, [&row](const PhaseRow& each) {
        return each.workload == row.workload && each.unit == row.unit;
      });
      // Without a figure there is nothing to miss.
      if (has_cell && (!of_base || !is_used(row))) continue;
      if (!has_cell && !told.emplace(row.workload, row.unit).second) continue;
      GateRow missing{.workload = row.workload,
                      .unit = row.unit,
                      .phase = has_cell ? row.phase_name() : "all",
                      .setup = has_cell && is_setup(row.phase)};
      if (!of_base) {
        judge_new(*profile, missing);
      } else if (has_cell) {
        missing.verdict = GateVerdict::kUndecided;
        missing.reason = "the candidate has no such phase";
      } else if (!is_lost(lost_by(other, {row.workload, row.unit}, 0), missing)) {
        missing.verdict = GateVerdict::kNotComparable;
        missing.reason = "the candidate has no such cell, nor planned it";
      }
      rows.push_back(std::move(missing));
    }
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
    case GateVerdict::kUndecided:
      return "undecided";
    case GateVerdict::kNotComparable:
      return "not comparable";
    case GateVerdict::kNotJudged:
      return "not judged";
  }
  return "";
}

double percent_of(double log_ratio) { return 100 * std::expm1(log_ratio); }

std::int64_t GateResult::count(GateVerdict verdict) const {
  return std::ranges::count(rows, verdict, &GateRow::verdict);
}

GateResult judge(const ProfileDiff& diff, const GateThresholds& thresholds) {
  GateResult result;
  result.identity = diff.identity;
  const Movements movements(diff, thresholds);
  result.machine = movements.machine();
  for (const auto& pair : diff.phases) {
    result.rows.push_back(compare(diff, pair, movements, thresholds));
    if (result.rows.back().verdict == GateVerdict::kSlower && !repeats(pair) &&
        !movements.knows_scatter(family_of(*pair.a)) &&
        (pair.a->pooled_runs.empty() || pair.b->pooled_runs.empty())) {
      result.unsure.insert(pair.a->unit);
    }
    const bool comparable = result.rows.back().ratio.has_value();
    if (pair.a->phase == Phase::kCall && comparable && !repeats(pair)) {
      const Allowance allowed = movements.allowance_for(*pair.a, *pair.b);
      const double moved =
          std::max(allowed.slower,
                   std::min(allowed.scatter, std::max(0.0, std::log(*result.rows.back().ratio))));
      result.rows.push_back(compare_tails(pair, doubt_of(diff, pair), std::exp(moved), thresholds));
    }
  }
  result.rows.insert(result.rows.end(), movements.rows().begin(), movements.rows().end());
  for (const auto& pair : diff.energies) {
    result.rows.push_back(compare_energy(diff, pair, movements, thresholds));
  }
  add_missing(diff, result.rows);
  return result;
}

void add_anchor(GateResult against, GateResult& result) {
  result.anchor_identity = std::move(against.identity);
  result.anchor_machine = std::move(against.machine);
  result.unsure.merge(against.unsure);
  std::set<std::pair<std::string, std::string>> cells;
  for (const GateRow& row : result.rows) cells.emplace(row.workload, row.unit);
  for (GateRow& row : against.rows) {
    // What neither base nor candidate has was taken away, and somebody accepted it.
    const bool gone = row.verdict == GateVerdict::kNotComparable && row.workload != "all" &&
                      !cells.contains({row.workload, row.unit});
    if (gone || row.is_new) continue;
    row.against_anchor = true;
    result.rows.push_back(std::move(row));
  }
}

}  // namespace pirt
