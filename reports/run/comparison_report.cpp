#include "reports/run/comparison_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <limits>
#include <set>
#include <string>

#include "reports/document/figures.h"
#include "reports/run/run_report.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

std::string ratio(std::optional<double> value, double best) {
  return value && best > 0 ? fmt::format("{:.2f}x", *value / best) : "-";
}

template <typename Figure>
double least(const std::vector<RunRecord>& runs, const Figure& figure) {
  double best = std::numeric_limits<double>::infinity();
  for (const auto& run : runs) best = std::min(best, figure(run).value_or(best));
  return best == std::numeric_limits<double>::infinity() ? 0 : best;
}

/// Units that serve something and draw nobody knows what.
std::set<std::string> unknown_power(const std::vector<RunRecord>& runs) {
  std::set<std::string> units;
  for (const RunRecord& run : runs) {
    for (const UnitResult& unit : run.units) {
      if (unit.busy_s > 0 && !unit.energy_j) units.insert(unit.unit);
    }
  }
  return units;
}

std::int64_t deadline_misses(const RunRecord& run) {
  std::int64_t misses = 0;
  for (const auto& pipeline : run.pipelines) misses += pipeline.deadline_misses.value_or(0);
  return misses;
}

std::string in_short(const std::vector<RunRecord>& runs) {
  std::vector<NamedFigure> rates, joules, tails;
  for (const RunRecord& run : runs) {
    rates.push_back({run.mode, run.throughput_per_ms});
    joules.push_back({run.mode, run.energy_j});
    tails.push_back({run.mode, run.p99_latency_ms});
  }
  return fmt::format("In short: most tasks/ms: {}; least energy: {}; least p99: {}.",
                     best_of(rates, true), best_of(joules), best_of(tails));
}

Table table_of(const ModeRuns& comparison) {
  Table table{.title = "Modes",
              .columns = {{"mode", Align::kLeft},
                          {"tasks/ms"},
                          {"gap %"},
                          {"energy J"},
                          {"gap %"},
                          {"costs"},
                          {"mean ms"},
                          {"p99 ms"},
                          {"costs"},
                          {"late"},
                          {"dropped"},
                          {"queued"},
                          {"offloaded"},
                          {"in flight"},
                          {"weights", Align::kLeft}}};
  const auto energy = [](const RunRecord& run) { return run.energy_j; };
  const auto tail = [](const RunRecord& run) { return run.p99_latency_ms; };
  const double least_energy = least(comparison.runs, energy);
  const double least_tail = least(comparison.runs, tail);
  for (const auto& run : comparison.runs) {
    const RunBounds bounds = run.bounds.value_or(RunBounds{});
    const RunMarks marks = marks_of(run);
    table.rows.push_back(
        {run.mode, shown(run.throughput_per_ms, marks.time),
         gap_text(run.throughput_per_ms, bounds.throughput_per_ms),
         shown(run.energy_j, marks.energy), gap_text(run.energy_j, bounds.energy_j),
         ratio(energy(run), least_energy), shown(run.mean_latency_ms, marks.time),
         shown(run.p99_latency_ms, marks.time), ratio(tail(run), least_tail),
         fmt::format("{}", deadline_misses(run)), fmt::format("{}", run.dropped + run.expired),
         fmt::format("{}", run.queued), fmt::format("{}", run.offloaded),
         run.in_flight ? fmt::format("{}", *run.in_flight) : "-", run.weights_from.value_or("-")});
  }
  table.footnotes = {
      "gap = reached / bound - 1: to the throughput that no scheduler can exceed, and to the least "
      "energy for what the "
      "mode completed in its makespan.",
      "costs: times the least energy and the least p99 task latency of the table. late: firings "
      "past their deadline. in flight: frames of a closed loop at a time. weights: where they come "
      "from."};
  for (const std::string& unit : unknown_power(comparison.runs)) {
    table.footnotes.push_back(fmt::format(
        "energy -: nobody knows what {} draws; give it with --set {}.active_w=W.", unit, unit));
  }
  for (const auto& skipped : comparison.skipped) {
    table.footnotes.push_back(fmt::format("Not run: {}: {}", skipped.mode, skipped.reason));
  }
  table.footnotes.emplace_back(provenance_legend());
  if (comparison.runs.size() > 1) table.footnotes.push_back(in_short(comparison.runs));
  return table;
}

const RunRecord* find_run(const ModeRuns& comparison, const std::string& mode) {
  const auto found = std::ranges::find(comparison.runs, mode, &RunRecord::mode);
  return found == comparison.runs.end() ? nullptr : &*found;
}

std::string tail_text(const PipelineResult& pipeline, Origin time) {
  auto text = "p99 " + shown(pipeline.p99_ms, time) + " ms";
  if (pipeline.deadline_misses) {
    text += fmt::format(", {} of {} late", *pipeline.deadline_misses,
                        pipeline.completed + pipeline.unfinished);
  }
  return text;
}

/// What mode advanced's strict priority of images does to the real-time pipelines that have none.
Paragraph starvation(const ModeRuns& comparison, const Mix& mix) {
  Paragraph paragraph;
  for (const auto& advanced : comparison.runs) {
    const RunRecord* basic = advanced.basic ? find_run(comparison, *advanced.basic) : nullptr;
    if (basic == nullptr) continue;
    for (std::size_t p = 0; p < mix.pipelines.size(); ++p) {
      if (!mix.pipelines[p].real_time || mix.pipelines[p].has_image_input()) continue;
      paragraph.lines.push_back(fmt::format(
          "{} without images, under strict priority of images ({}): {}; without ({}): {}",
          mix.pipelines[p].name, advanced.mode,
          tail_text(advanced.pipelines[p], marks_of(advanced).time), basic->mode,
          tail_text(basic->pipelines[p], marks_of(*basic).time)));
    }
  }
  return paragraph;
}

}  // namespace

Document comparison_document(const ModeRuns& comparison, const Mix& mix) {
  Document document{.title = "pirt schedule --compare", .parts = {}};
  if (!comparison.runs.empty()) {
    const RunRecord& run = comparison.runs.front();
    Paragraph header{{fmt::format("Mix {} on platform {}, {} time, seed {}", run.mix, run.platform,
                                  run.time, run.seed)}};
    if (run.assumptions) header.lines.push_back(*run.assumptions);
    document.parts.emplace_back(std::move(header));
  }
  document.parts.emplace_back(table_of(comparison));
  auto lines = starvation(comparison, mix);
  if (!lines.lines.empty()) document.parts.emplace_back(std::move(lines));
  return document;
}

Json comparison_json(const ModeRuns& comparison) {
  auto runs = Json::array();
  for (const auto& run : comparison.runs) runs.push_back(to_json(run));
  auto skipped = Json::array();
  for (const auto& each : comparison.skipped) {
    skipped.push_back({{"mode", each.mode}, {"reason", each.reason}});
  }
  return {{"schema_version", RunRecord::kSchemaVersion}, {"runs", runs}, {"skipped", skipped}};
}

}  // namespace pirt
