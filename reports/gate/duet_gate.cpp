#include "reports/gate/duet_gate.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "characterize/statistics/proportions.h"
#include "characterize/statistics/rank_tests.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// From here on two units are apart, and a candidate may be faster.
constexpr double kApart = 0.05;
/// What is less likely by chance is none: that the candidate lacks a figure so much more often.
constexpr double kChance = 0.05;

/// How likely so many blocks are to be faster by chance; 1 if they are not by enough.
double faster_p(const DuetRule& rule) {
  if (rule.effect() > std::log1p(-kApart)) return 1;
  return sign_test_p_below(rule.blocks(), 0);
}

std::string blocks_text(std::size_t count) {
  return fmt::format("{} block{}", count, count == 1 ? "" : "s");
}

std::string undecided_reason(const DuetCellState& state, const DuetRule& rule, DuetEnd end) {
  const std::string blocks = blocks_text(rule.blocks().size() + rule.confirmation().size());
  if (state.ended()) return blocks + " before the cell ended";
  return fmt::format("{} after {}; go on to decide it",
                     end == DuetEnd::kStopped ? "interrupted" : "the time was up", blocks);
}

std::string inconclusive_reason(const DuetSeries& series) {
  const std::size_t blocks = series.rule.blocks().size() + series.rule.confirmation().size();
  if (series.without < kMostWithout) {
    return fmt::format("neither slower nor not after {} blocks: too noisy here", blocks);
  }
  return fmt::format("it was missing, or 0, in {} of {} blocks", series.without,
                     blocks + series.without);
}

/// What to say where the candidate had no figure more often than the baseline: what is left may be
/// its best runs. Empty if it had not.
std::string without_text(const RunsWithout& runs) {
  const auto [of_base, of_candidate] = runs;
  if (of_candidate <= of_base) return "";
  return fmt::format(
      "{} of the candidate's runs lacked the figure, or a 0 that is the best there is, {} of the "
      "baseline's",
      of_candidate, of_base);
}

/// Whether that is more than chance.
bool lacks_more_often(const DuetSeries& series) {
  const auto runs = static_cast<std::int64_t>(
      2 * (series.rule.blocks().size() + series.rule.confirmation().size() + series.without));
  const auto [of_base, of_candidate] = series.runs_without;
  return fisher_p(static_cast<std::int64_t>(of_base), runs, static_cast<std::int64_t>(of_candidate),
                  runs) < kChance;
}

GateRow series_row(const DuetCellState& state, const std::string& phase, const DuetSeries& series,
                   DuetEnd end) {
  GateRow row{.workload = state.cell.workload, .unit = state.cell.unit, .phase = phase};
  const DuetRule& rule = series.rule;
  const bool is_time = series.measure.unit == "s";
  if (!is_time) row.measure = series.measure.unit;
  if (!series.base_s.empty()) {
    row.base = (is_time ? 1e9 : 1) * median_of(series.base_s);
    row.candidate = (is_time ? 1e9 : 1) * median_of(series.candidate_s);
    row.ratio = std::exp(series.measure.higher_is_better ? -rule.effect() : rule.effect());
  }
  switch (rule.verdict()) {
    case DuetVerdict::kUndecided:
      row.verdict = GateVerdict::kInconclusive;
      row.reason = undecided_reason(state, rule, end);
      break;
    case DuetVerdict::kNotSlower:
      row.reason = without_text(series.runs_without);
      if (lacks_more_often(series)) {
        row.verdict = GateVerdict::kInconclusive;
        break;
      }
      row.p = faster_p(rule);
      row.verdict = *row.p < 1 ? GateVerdict::kFaster : GateVerdict::kSame;
      if (row.verdict == GateVerdict::kSame) row.p.reset();
      break;
    case DuetVerdict::kSlower:
      row.verdict = GateVerdict::kSlower;
      row.p = rule.p_value();
      break;
    case DuetVerdict::kInconclusive:
      row.verdict = GateVerdict::kInconclusive;
      row.reason = inconclusive_reason(series);
      break;
    case DuetVerdict::kRefused:
      row.verdict = GateVerdict::kInconclusive;
      row.reason = fmt::format(
          "the baseline differs from itself by {:+.1f} %: the machine is too unquiet; see pirt "
          "doctor",
          percent_of(median_of(rule.canaries())));
      break;
  }
  return row;
}

/// Figures of the first processes that no series is made of.
void add_not_judged(const DuetCellState& state, std::vector<GateRow>& rows) {
  if (!state.checks[0] || !state.checks[1]) return;
  const auto add = [&](const std::string& name, std::string reason,
                       GateVerdict verdict = GateVerdict::kNotJudged) {
    rows.push_back({.workload = state.cell.workload,
                    .unit = state.cell.unit,
                    .phase = name,
                    .verdict = verdict,
                    .reason = std::move(reason)});
  };
  for (const auto& [name, runs] : state.passing) {
    const std::string without = without_text(runs);
    if (without.empty()) {
      add(name, "it is not above 0 in each of the first processes");
    } else {
      add(name, without, GateVerdict::kInconclusive);
    }
  }
  for (const Side side : {Side::kBaseline, Side::kCandidate}) {
    const auto& own = state.checks[static_cast<std::size_t>(side)]->seconds;
    const auto& other = state.checks[side == Side::kBaseline ? 1 : 0]->seconds;
    for (const auto& [name, value] : own) {
      const bool both = other.contains(name);
      if (both && (side == Side::kCandidate || (value > 0 && other.at(name) > 0))) continue;
      if (state.passing.contains(name) || state.series.contains(name)) continue;
      const auto measure = state.checks[0]->measures.find(name);
      const bool more_is_better =
          measure != state.checks[0]->measures.end() && measure->second.higher_is_better;
      // `value` is the baseline's then. A phase that took no time by the clock has not risen.
      const bool rose =
          both && state.cell.workload == kCommandCell && value >= 0 && other.at(name) > 0;
      if (both && (more_is_better ? value > 0 : rose)) {
        add(name, more_is_better ? "it fell to 0" : "it rose from 0", GateVerdict::kInconclusive);
        continue;
      }
      add(name, both ? "it is not above 0 on both sides, so that there is no ratio"
                     : fmt::format("only the {} has it", to_string(side)));
    }
  }
}

/// What concerns all phases of a cell; nothing if nothing does.
std::optional<GateRow> cell_row(const DuetCellState& state, DuetEnd end) {
  GateRow row{.workload = state.cell.workload, .unit = state.cell.unit, .phase = "all"};
  const std::string blocks =
      state.blocks == 0 ? "" : fmt::format(" ({} measured before)", blocks_text(state.blocks));
  const auto& of_base = state.failures[static_cast<std::size_t>(Side::kBaseline)];
  const auto& of_candidate = state.failures[static_cast<std::size_t>(Side::kCandidate)];
  if (!of_base.empty()) {
    row.verdict = GateVerdict::kNotComparable;
    row.reason = "the baseline failed: " + of_base + blocks;
  } else if (!of_candidate.empty()) {
    row.verdict = GateVerdict::kFailed;
    row.reason = "the candidate failed: " + of_candidate + blocks;
  } else if (!state.not_comparable.empty()) {
    row.verdict = GateVerdict::kNotComparable;
    row.reason = state.not_comparable;
  } else if (state.series.empty()) {
    row.verdict = GateVerdict::kInconclusive;
    row.reason = end == DuetEnd::kStopped ? "interrupted before its first block"
                                          : "the time was up before its first block";
  } else {
    return std::nullopt;
  }
  return row;
}

/// Takes back what is not sure enough among so many rows.
/// @param rows  Those of series and cells alone: only they are decided together.
void correct(std::vector<GateRow>& rows, double alpha) {
  for (const GateVerdict claim : {GateVerdict::kSlower, GateVerdict::kFaster}) {
    std::vector<double> p_values;
    std::vector<GateRow*> judged;
    for (GateRow& row : rows) {
      if (row.phase == "all") continue;
      p_values.push_back(row.verdict == claim ? row.p.value_or(1) : 1);
      judged.push_back(&row);
    }
    const auto adjusted = holm_adjusted(p_values);
    for (std::size_t i = 0; i < judged.size(); ++i) {
      GateRow& row = *judged[i];
      if (row.verdict != claim) continue;
      row.p = adjusted[i];
      if (adjusted[i] < alpha) continue;
      row.verdict = claim == GateVerdict::kSlower ? GateVerdict::kInconclusive : GateVerdict::kSame;
      if (claim == GateVerdict::kFaster) continue;
      row.reason = fmt::format("slower by itself, but not for sure among {} rows", judged.size());
    }
  }
}

}  // namespace

GateResult judge_duet(const DuetComparison& comparison, DuetEnd end, double alpha) {
  GateResult result;
  for (const DuetCellState& state : comparison.cells()) {
    if (auto row = cell_row(state, end)) result.rows.push_back(std::move(*row));
    for (const auto& [phase, series] : state.series) {
      result.rows.push_back(series_row(state, phase, series, end));
    }
  }
  correct(result.rows, alpha);
  for (const DuetCellState& state : comparison.cells()) add_not_judged(state, result.rows);
  return result;
}

std::vector<Flip> find_flips(const GateResult& result) {
  std::map<std::string, std::vector<const GateRow*>> workloads;
  for (const GateRow& row : result.rows) {
    if (row.phase == "call" && row.base && row.candidate) workloads[row.workload].push_back(&row);
  }
  std::vector<Flip> flips;
  for (const auto& [workload, rows] : workloads) {
    const auto* before = *std::ranges::min_element(rows, {}, &GateRow::base);
    const auto* after = *std::ranges::min_element(rows, {}, &GateRow::candidate);
    if (before == after) continue;
    const bool clear = *after->base > (1 + kApart) * *before->base &&
                       *before->candidate > (1 + kApart) * *after->candidate;
    flips.push_back({workload, "time", before->unit, after->unit, clear});
  }
  return flips;
}

void describe_rule(GateReport& report) {
  constexpr std::size_t kMostNamed = 10;
  std::vector<std::string> not_judged;
  for (const GateRow& row : report.result.rows) {
    if (row.verdict != GateVerdict::kNotJudged) continue;
    const std::string cell =
        row.workload == kCommandCell ? "" : to_string(DuetCell{row.workload, row.unit}) + ", ";
    not_judged.push_back(fmt::format("{}{} ({})", cell, row.phase, row.reason));
  }
  if (not_judged.size() > kMostNamed) {
    const std::size_t more = not_judged.size() - kMostNamed;
    not_judged.resize(kMostNamed);
    not_judged.push_back(fmt::format("and {} more", more));
  }
  if (!not_judged.empty()) report.notes.push_back("Not judged: " + join(not_judged, "; ") + ".");
  const DuetThresholds t;
  const DuetThresholds setup = setup_thresholds();
  report.rule = {
      "change: median of blocks, each the mean log ratio of four fresh processes in order ABBA or "
      "BAAB.",
      fmt::format("slower: {} or more blocks, the {:.1f} % lower bound above {:.0f} % and the "
                  "median above {:.0f} % (set-up: {:.0f} and {:.0f} %), confirmed on {} to {} "
                  "fresh blocks; p of those, Holm-adjusted over the table, below {}.",
                  t.first_suspicion, 100 * t.bound_confidence, 100 * t.suspicious_bound,
                  100 * t.suspicious_median, 100 * setup.suspicious_bound,
                  100 * setup.suspicious_median, t.confirmations.front(), t.confirmations.back(),
                  t.alpha)};
  report.rule_json = {{"looks", t.looks},
                      {"first_suspicion", t.first_suspicion},
                      {"confirmations", t.confirmations},
                      {"bound_confidence", t.bound_confidence},
                      {"alpha", t.alpha},
                      {"canary_median", t.canary_median},
                      {"canary_alpha", t.canary_alpha}};
  const auto effects = [](const DuetThresholds& of) {
    return Json{{"suspicious_bound", of.suspicious_bound},
                {"suspicious_median", of.suspicious_median},
                {"futile_median", of.futile_median},
                {"open_bound", of.open_bound},
                {"first_futility", of.first_futility}};
  };
  report.rule_json["calls"] = effects(t);
  report.rule_json["setup"] = effects(setup);
}

}  // namespace pirt
