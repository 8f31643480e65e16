// Section V: a robot without and with the runtime, on the paper's board as it is modelled and on
// this machine.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "reports/document/figures.h"
#include "reports/paper/scorecard.h"
#include "reports/run/run_report.h"

namespace pirt {
namespace {

/// What the robot without the runtime may be off by: relative, as the cells of Table V (see
/// paper_cells), or the one firing that a minute cuts off.
constexpr double kFittedLimit = 0.02;
constexpr double kOneFiring = 1.0 / 60;

/// A figure of Section V, in the unit of its claim.
struct RobotFigure {
  const char* claim;
  const char* unit;
  double Section5Row::*figure;
  bool at_most;  ///< The paper's is a limit; otherwise a goal.
};
constexpr RobotFigure kLocalization = {"{} localizations a second", "Hz",
                                       &Section5Row::localization_fps, false};
constexpr RobotFigure kRecognition = {"{} recognitions a second", "Hz",
                                      &Section5Row::recognitions_per_s, false};
constexpr RobotFigure kPlanning = {"a path is planned within {} ms (p99)", "ms",
                                   &Section5Row::planning_p99_ms, true};
constexpr RobotFigure kPower = {"{} W", "W", &Section5Row::power_w, true};

Claim claim_of(const RobotFigure& what, double paper, const std::string& run) {
  return {.where = "Section V",
          .claim = fmt::format(fmt::runtime(what.claim), figure(paper)) + ", " + run +
                   ", on the paper's board",
          .paper = marked(figure(paper), Provenance::kPublished) + " " + what.unit};
}

std::string shown_here(const RobotFigure& what, double value) {
  return marked(figure(value), Provenance::kFitted) + " " + what.unit;
}

/// What the CPU's times were fitted to.
std::vector<Claim> without_runtime(const Section5& section) {
  std::vector<Claim> claims;
  for (const RobotFigure& what : {kLocalization, kRecognition, kPower}) {
    const double paper = section.paper_without.*what.figure, ours = section.fitted.*what.figure;
    claims.push_back(fitted_to(
        claim_of(what, paper, "on the CPU alone"),
        std::abs(ours - paper) <= std::max(kFittedLimit * paper, kOneFiring),
        shown_here(what, ours),
        fmt::format("{:+.1f} %: the CPU's times were fitted to it", 100 * (ours / paper - 1))));
  }
  return claims;
}

const Section5Row& best_in(const std::vector<Section5Row>& rows, const RobotFigure& what) {
  return *std::ranges::min_element(rows, {}, [&](const Section5Row& row) {
    return what.at_most ? row.*what.figure : -(row.*what.figure);
  });
}

bool reaches(const RobotFigure& what, double value, double goal) {
  return what.at_most ? value <= goal * (1 + kAlmost) : value >= goal * (1 - kAlmost);
}

/// Throughput mode is the one that Section V speaks of; the others may do better.
std::vector<Claim> with_runtime(const Section5& section) {
  const auto own = std::ranges::find(section.predictions, "throughput", &Section5Row::mode);
  std::vector<Claim> claims;
  for (const RobotFigure& what : {kLocalization, kRecognition, kPlanning, kPower}) {
    const double paper = section.paper_with.*what.figure;
    Claim claim = claim_of(what, paper, "in throughput mode");
    if (own == section.predictions.end()) {
      claims.push_back(not_testable(claim, "the mode could not run"));
      continue;
    }
    const double ours = (*own).*what.figure;
    const Section5Row& best = best_in(section.predictions, what);
    claims.push_back(decided(
        claim, reaches(what, ours, paper), shown_here(what, ours), "virtual time, fitted",
        fmt::format("predicted from the CPU's times by the ratios of Tables IV and V; best in "
                    "this alone: {}, {} {}",
                    best.mode, figure(best.*what.figure), what.unit)));
  }
  return claims;
}

/// Each task where Section V says that it mainly ran.
Claim as_placed(const Section5& section) {
  const double paper = section.paper_with.localization_fps;
  const Claim claim = claim_of(kLocalization, paper, "placed as Section V says");
  if (section.placed.empty()) return not_testable(claim, "no mode could run");
  const Section5Row& best = best_in(section.placed, kLocalization);
  return decided(claim, reaches(kLocalization, best.localization_fps, paper),
                 shown_here(kLocalization, best.localization_fps), "virtual time, fitted",
                 fmt::format("best mode: {}; by Table V, the only figures for it, the DSP takes "
                             "longer than the CPU",
                             best.mode));
}

const PipelineResult* find_pipeline(const RunRecord& run, std::string_view part) {
  const auto found = std::ranges::find_if(run.pipelines, [&](const PipelineResult& pipeline) {
    return pipeline.pipeline.find(part) != std::string::npos;
  });
  return found == run.pipelines.end() ? nullptr : &*found;
}

Claim rate_claim(const RunRecord& run, const char* pipeline, double hz, const std::string& paper) {
  Claim claim{.where = "Section V",
              .claim = fmt::format("{} at {} a second, on this machine", pipeline, figure(hz)),
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
  Claim claim{.where = "Section V",
              .claim = "a path is planned within 6 ms, on this machine",
              .paper = "+6 ms"};
  const auto* found = find_pipeline(run, "plan");
  if (found == nullptr || !found->p99_ms) {
    return not_testable(claim, "the mix has no pipeline that plans");
  }
  const Origin from = marks_of(run).time;
  return decided(claim, *found->p99_ms <= 6, "p99 " + shown(found->p99_ms, from) + " ms",
                 "virtual time, " + std::string(to_string(from)),
                 run.mode + " mode on " + run.platform);
}

Claim power_claim(const Evidence& evidence, const RunRecord& run) {
  Claim claim{
      .where = "Section V", .claim = "all of it within 11 W, on this machine", .paper = "+11 W"};
  if (!run.average_power_w) return not_testable(claim, "the run has no power");
  const Origin from = marks_of(run).energy;
  claim.here = shown(run.average_power_w, from) + " W";
  if (!watts_are_known(evidence, run)) return not_testable(claim, kAssumedWatts);
  return decided(claim, *run.average_power_w <= 11, shown(run.average_power_w, from) + " W",
                 "virtual time, " + std::string(to_string(from)),
                 run.mode + " mode on " + run.platform);
}

/// Without the runtime, on the CPU alone.
Claim cpu_only_claim(const RunRecord& run) {
  Claim claim{.where = "Section V",
              .claim = "this machine's CPU alone does not reach 25 localizations a second",
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

std::vector<Claim> on_this_machine(const Evidence& evidence) {
  const auto* with =
      evidence.modes == nullptr ? nullptr : find_mode(evidence.modes->runs, "throughput");
  if (with == nullptr) {
    return {not_testable(
        {.where = "Section V",
         .claim = "25 localizations and 3 recognitions a second, planning in 6 ms, "
                  "11 W, on this machine",
         .paper = "-"},
        evidence.profile == nullptr ? "no profile given" : "the profile does not serve the mix")};
  }
  std::vector<Claim> claims = {rate_claim(*with, "localization", 25, "+25 Hz"),
                               rate_claim(*with, "recognition", 3, "+3 Hz"), planning_claim(*with),
                               power_claim(evidence, *with)};
  if (const auto* without = find_mode(evidence.modes->runs, "cpu-only")) {
    claims.push_back(cpu_only_claim(*without));
  }
  claims.push_back(not_testable({.where = "Section V",
                                 .claim = "map generation: hours on the robot, under five minutes "
                                          "in the cloud",
                                 .paper = "+5 min"},
                                "no cloud was measured"));
  return claims;
}

}  // namespace

std::vector<Claim> section5_claims(const Evidence& evidence) {
  std::vector<Claim> claims;
  if (evidence.section5 != nullptr) {
    append(claims, without_runtime(*evidence.section5));
    append(claims, with_runtime(*evidence.section5));
    claims.push_back(as_placed(*evidence.section5));
  }
  append(claims, on_this_machine(evidence));
  return claims;
}

}  // namespace pirt
