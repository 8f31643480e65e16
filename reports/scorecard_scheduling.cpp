// Table V and Section V: on the paper's board as it is modelled, and on this machine.
#include <fmt/core.h>

#include <algorithm>
#include <iterator>

#include "reports/figures.h"
#include "reports/run_report.h"
#include "reports/scorecard.h"
#include "scheduler/policies/policy.h"

namespace pirt {
namespace {

constexpr double kAlmost = 0.01;  ///< So much short of a rate or a bound is still there.

const RunRecord* find_mode(const std::vector<RunRecord>& runs, const std::string& mode) {
  const auto found = std::ranges::find(runs, mode, &RunRecord::mode);
  return found == runs.end() ? nullptr : &*found;
}

std::vector<Claim> fitted_cells(const std::vector<PaperCell>& cells) {
  std::vector<Claim> claims;
  for (const PaperCell& cell : cells) {
    claims.push_back(decided(
        {.where = "Table V",
         .claim = fmt::format("{} mode: {}", cell.mode, cell.figure),
         .paper = marked(fmt::format("{:.4g}", cell.paper), Provenance::kPublished)},
        cell.holds(), marked(fmt::format("{:.4g}", cell.ours), Provenance::kFitted), "fitted",
        fmt::format("{:+.1f} %, limit {:.0f} %: the board was fitted to it", 100 * cell.deviation(),
                    100 * cell.limit)));
  }
  return claims;
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
    {"latency", "ms mean latency", [](const RunRecord& r) { return r.mean_latency_ms; }, true},
    {"latency", "ms p99 latency", [](const RunRecord& r) { return r.p99_latency_ms; }, true},
    {"energy", "J", [](const RunRecord& r) { return std::optional(r.energy_j); }, true}};

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

const PipelineResult* find_pipeline(const RunRecord& run, std::string_view part) {
  const auto found = std::ranges::find_if(run.pipelines, [&](const PipelineResult& pipeline) {
    return pipeline.pipeline.find(part) != std::string::npos;
  });
  return found == run.pipelines.end() ? nullptr : &*found;
}

Claim rate_claim(const RunRecord& run, const char* pipeline, double hz, const std::string& paper) {
  Claim claim{.where = "Section V",
              .claim = fmt::format("{} at {} a second", pipeline, figure(hz)),
              .paper = paper};
  const auto* found = find_pipeline(run, pipeline);
  if (found == nullptr || !found->rate_hz) {
    return not_testable(claim, fmt::format("the mix has no pipeline {}", pipeline));
  }
  const Origin from = marks_of(run).time;
  return decided(
      claim, *found->rate_hz >= hz * (1 - kAlmost), shown(found->rate_hz, from) + " Hz",
      "virtual time, " + std::string(to_string(from)),
      fmt::format("{} mode on {}{}", run.mode, run.platform,
                  found->deadline_misses ? fmt::format(", {} late", *found->deadline_misses) : ""));
}

Claim planning_claim(const RunRecord& run) {
  Claim claim{.where = "Section V", .claim = "a path is planned within 6 ms", .paper = "+6 ms"};
  const auto* found = find_pipeline(run, "plan");
  if (found == nullptr || !found->p99_ms) {
    return not_testable(claim, "the mix has no pipeline that plans");
  }
  const Origin from = marks_of(run).time;
  return decided(claim, *found->p99_ms <= 6, "p99 " + shown(found->p99_ms, from) + " ms",
                 "virtual time, " + std::string(to_string(from)),
                 run.mode + " mode on " + run.platform);
}

Claim power_claim(const RunRecord& run) {
  Claim claim{.where = "Section V", .claim = "all of it within 11 W", .paper = "+11 W"};
  if (!run.average_power_w) return not_testable(claim, "the run has no power");
  const Origin from = marks_of(run).energy;
  return decided(claim, *run.average_power_w <= 11, shown(run.average_power_w, from) + " W",
                 "virtual time, " + std::string(to_string(from)),
                 run.mode + " mode on " + run.platform);
}

/// Without the runtime, on the CPU alone.
Claim cpu_only_claim(const RunRecord& run) {
  Claim claim{.where = "Section V",
              .claim = "the CPU alone does not reach 25 localizations a second",
              .paper = "+15 Hz"};
  const auto* found = find_pipeline(run, "localization");
  if (found == nullptr || !found->rate_hz) {
    return not_testable(claim, "the mix has no pipeline localization");
  }
  const Origin from = marks_of(run).time;
  return decided(
      claim, *found->rate_hz < 25 * (1 - kAlmost), shown(found->rate_hz, from) + " Hz",
      "virtual time, " + std::string(to_string(from)),
      fmt::format("on {}, another CPU; {} late", run.platform, found->deadline_misses.value_or(0)));
}

std::vector<Claim> section_five(const Evidence& evidence) {
  const auto* with =
      evidence.modes == nullptr ? nullptr : find_mode(evidence.modes->runs, "throughput");
  if (with == nullptr) {
    return {not_testable(
        {.where = "Section V",
         .claim = "25 localizations and 3 recognitions a second, planning in 6 ms, "
                  "11 W",
         .paper = "-"},
        evidence.profile == nullptr ? "no profile given" : "the profile does not serve the mix")};
  }
  std::vector<Claim> claims = {rate_claim(*with, "localization", 25, "+25 Hz"),
                               rate_claim(*with, "recognition", 3, "+3 Hz"), planning_claim(*with),
                               power_claim(*with)};
  if (const auto* without = find_mode(evidence.modes->runs, "cpu-only")) {
    claims.push_back(cpu_only_claim(*without));
  }
  claims.push_back(not_testable({.where = "Section V",
                                 .claim = "on the CPU alone a recognition takes 1.5 s, at 10 W",
                                 .paper = "+1.5 s, +10 W"},
                                "a Snapdragon 820 under load; this is another machine"));
  claims.push_back(not_testable({.where = "Section V",
                                 .claim = "map generation: hours on the robot, under five minutes "
                                          "in the cloud",
                                 .paper = "+5 min"},
                                "no cloud was measured"));
  return claims;
}

void append(std::vector<Claim>& to, std::vector<Claim> more) {
  to.insert(to.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
}

}  // namespace

std::vector<Claim> scheduling_claims(const Evidence& evidence) {
  std::vector<Claim> claims;
  if (evidence.cells != nullptr) append(claims, fitted_cells(*evidence.cells));
  append(claims, on_the_fitted_board());
  if (evidence.table5 != nullptr) {
    for (const Goal& goal : kGoals) {
      claims.push_back(best_of(goal, evidence.table5->runs, "the three", "on this machine"));
    }
  }
  append(claims, section_five(evidence));
  return claims;
}

}  // namespace pirt
