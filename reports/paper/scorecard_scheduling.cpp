// Table V: on the paper's board as it is modelled, and on this machine.
#include <fmt/core.h>

#include <algorithm>
#include <iterator>

#include "reports/document/figures.h"
#include "reports/paper/scorecard.h"
#include "reports/run/run_report.h"
#include "scheduler/policies/policy.h"

namespace pirt {
namespace {

std::vector<Claim> fitted_cells(const std::vector<PaperCell>& cells) {
  std::vector<Claim> claims;
  for (const PaperCell& cell : cells) {
    claims.push_back(
        fitted_to({.where = "Table V",
                   .claim = fmt::format("{} mode: {}", cell.mode, cell.figure),
                   .paper = marked(fmt::format("{:.4g}", cell.paper), Provenance::kPublished)},
                  cell.holds(), marked(fmt::format("{:.4g}", cell.ours), Provenance::kFitted),
                  fmt::format("{:+.1f} %, limit {:.0f} %: the board was fitted to it",
                              100 * cell.deviation(), 100 * cell.limit)));
  }
  return claims;
}

/// From a firing to its completion, whoever holds it meanwhile; the slowest pipeline's.
std::optional<double> firing_p99_ms(const RunRecord& run) {
  std::optional<double> most;
  for (const PipelineResult& pipeline : run.pipelines) {
    if (pipeline.p99_ms) most = std::max(most.value_or(0), *pipeline.p99_ms);
  }
  return most;
}

/// A figure of a run, and whether less of it is better.
struct Goal {
  const char* mode;
  const char* what;
  std::optional<double> (*of)(const RunRecord&);
  bool less;
};
constexpr Goal kGoals[] = {
    {"throughput", "tasks/ms", [](const RunRecord& r) { return r.throughput_per_ms; }, false},
    {"latency", "ms mean task latency", [](const RunRecord& r) { return r.mean_latency_ms; }, true},
    {"latency", "ms p99 from firing to completion", firing_p99_ms, true},
    {"energy", "J", [](const RunRecord& r) { return r.energy_j; }, true}};

/// Whether a mode is the best of some runs in what it is named after.
Claim best_of(const Goal& goal, const std::vector<RunRecord>& runs, const std::string& of_whom,
              const std::string& board) {
  Claim claim{
      .where = "Section IV, Table V",
      .claim = fmt::format("{} mode: best of {} in {}, {}", goal.mode, of_whom, goal.what, board),
      .paper = "-"};
  const RunRecord* own = find_mode(runs, goal.mode);
  if (own == nullptr || !goal.of(*own)) return not_testable(claim, "the mode could not run");
  const RunRecord* best = own;
  for (const RunRecord& run : runs) {
    const auto value = goal.of(run);
    const bool served = run.completed >= own->completed;  // dropping is no way to win
    if (!value || !served) continue;
    if (goal.less ? *value < *goal.of(*best) : *value > *goal.of(*best)) best = &run;
  }
  const RunMarks marks = marks_of(*own);
  const bool energy = std::string_view(goal.what) == "J";
  const Origin from = energy ? marks.energy : marks.time;
  const double reached = *goal.of(*own), limit = *goal.of(*best);
  const bool holds =
      goal.less ? reached <= limit * (1 + kAlmost) : reached >= limit * (1 - kAlmost);
  return decided(claim, holds,
                 marked(figure(reached), from) +
                     (holds ? "" : fmt::format(", {} {}", best->mode, marked(figure(limit), from))),
                 "virtual time, " + std::string(to_string(from)),
                 own->in_flight ? fmt::format("{} frames in flight", *own->in_flight) : "");
}

/// Modes named "optimal", against what no scheduler can beat.
Claim against_bound(const RunRecord& run, bool energy) {
  Claim claim{.where = "Section IV, Table V",
              .claim = energy ? "energy-optimal scheduling takes the least energy for its rate"
                              : "throughput-optimal scheduling reaches what the board allows",
              .paper = "-"};
  const auto value = energy ? gap(run.energy_j, run.bounds ? run.bounds->energy_j : std::nullopt)
                            : gap(run.throughput_per_ms,
                                  run.bounds ? run.bounds->throughput_per_ms : std::nullopt);
  if (!value) return not_testable(claim, "the run has no bound");
  return decided(claim, energy ? *value <= kAlmost : *value >= -kAlmost,
                 fmt::format("^{:+.1f} % off the bound", 100 * *value), "virtual time, fitted",
                 "linear programme over the fitted board");
}

std::vector<Claim> on_the_fitted_board() {
  const auto runs = run_modes(load_platform("snapdragon820"), nullptr, load_mix("convolution-1000"),
                              policy_names(), {})
                        .runs;
  std::vector<Claim> claims;
  for (const Goal& goal : kGoals) {
    claims.push_back(best_of(goal, runs, "all modes", "on the fitted board"));
  }
  for (const bool energy : {false, true}) {
    if (const auto* run = find_mode(runs, energy ? "energy" : "throughput")) {
      claims.push_back(against_bound(*run, energy));
    }
  }
  return claims;
}

/// What of a claim about this machine cannot be known on it; empty if all can.
std::string missing_here(const Evidence& evidence, const Goal& goal) {
  if (evidence.profile == nullptr || real_units(evidence).size() < 2) return kNoTwoRealUnits;
  const RunRecord* run = find_mode(evidence.table5->runs, goal.mode);
  const bool joules = std::string_view(goal.what) == "J";
  return joules && run != nullptr && !watts_are_known(evidence, *run) ? kAssumedWatts : "";
}

}  // namespace

std::vector<Claim> scheduling_claims(const Evidence& evidence) {
  std::vector<Claim> claims;
  if (evidence.cells != nullptr) append(claims, fitted_cells(*evidence.cells));
  append(claims, on_the_fitted_board());
  if (evidence.table5 != nullptr) {
    for (const Goal& goal : kGoals) {
      Claim claim = best_of(goal, evidence.table5->runs, "the three", "on this machine");
      const std::string missing = missing_here(evidence, goal);
      claims.push_back(missing.empty() ? std::move(claim) : not_testable(claim, missing));
    }
  }
  return claims;
}

}  // namespace pirt
