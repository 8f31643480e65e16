#include "reports/run/comparison_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <set>
#include <string>

#include "reports/document/figures.h"
#include "reports/run/answer.h"
#include "reports/run/pareto.h"
#include "reports/run/run_report.h"
#include "scheduler/record/keeping_up.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

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

std::string names(const std::vector<const RunRecord*>& runs) {
  std::vector<std::string> modes;
  for (const RunRecord* run : runs) modes.push_back(run->mode);
  return modes.empty() ? "-" : join(modes, " = ");
}

/// Of those that keep up, or of all where none does.
std::string in_short(const std::vector<RunRecord>& runs) {
  std::vector<const RunRecord*> among;
  for (const RunRecord& run : runs) {
    if (keeps_up(run)) among.push_back(&run);
  }
  if (among.empty()) {
    for (const RunRecord& run : runs) among.push_back(&run);
  }
  return fmt::format("In short: most tasks/ms: {}; least energy: {}; least {}: {}.",
                     names(best_by(among, "throughput_per_ms", true)),
                     names(best_by(among, "energy_j")), tail_name(runs),
                     names(best_by_tail(among, runs)));
}

/// Counts, weights and figures of tasks.
Table table_of(const ModeRuns& comparison) {
  Table table{.title = "Modes in detail",
              .columns = {{"mode", Align::kLeft},
                          {"rate gap %"},
                          {"energy gap %"},
                          {"task mean ms"},
                          {"task p99 ms"},
                          {"late"},
                          {"dropped"},
                          {"no predecessor"},
                          {"queued"},
                          {"offloaded"},
                          {"in flight"},
                          {"weights", Align::kLeft}}};
  const auto least_mj = least_energy_mj(comparison.runs);
  for (const auto& run : comparison.runs) {
    const RunBounds bounds = run.bounds.value_or(RunBounds{});
    const RunMarks marks = marks_of(run);
    table.rows.push_back(
        {run.mode, gap_text(run.throughput_per_ms, bounds.throughput_per_ms),
         gap_text(energy_mj(run), least_mj),
         shown_figure_of(run, "mean_latency_ms", run.mean_latency_ms, marks.time),
         shown_figure_of(run, "p99_latency_ms", run.p99_latency_ms, marks.time),
         fmt::format("{}", deadline_misses(run)), fmt::format("{}", dropped_tasks(run)),
         run.no_predecessor ? fmt::format("{}", *run.no_predecessor) : "-",
         fmt::format("{}", run.queued), fmt::format("{}", run.offloaded),
         run.in_flight ? fmt::format("{}", *run.in_flight) : "-", run.weights_from.value_or("-")});
  }
  table.footnotes = {
      "gap = reached / bound - 1: to the throughput that no scheduler can exceed, and, a task, to "
      "the least energy for what any of these completed.",
      "task: dispatch to completion, as the paper counts. late: firings past their deadline. "
      "dropped, no predecessor (of the first firings, which have none), queued, offloaded: tasks. "
      "in "
      "flight: frames of a closed loop at a time. weights: where they come from."};
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
    if (advanced.mix != mix.name || basic->mix != mix.name) continue;  // Stored runs of another.
    for (const Pipeline& pipeline : mix.pipelines) {
      if (!pipeline.real_time || pipeline.has_image_input()) continue;
      const PipelineResult* under = advanced.find_pipeline(pipeline.name);
      const PipelineResult* without = basic->find_pipeline(pipeline.name);
      if (under == nullptr || without == nullptr) continue;
      paragraph.lines.push_back(fmt::format(
          "{} without images, under strict priority of images ({}): {}; without ({}): {}",
          pipeline.name, advanced.mode, tail_text(*under, marks_of(advanced).time), basic->mode,
          tail_text(*without, marks_of(*basic).time)));
    }
  }
  return paragraph;
}

}  // namespace

Paragraph missing_of(const ModeRuns& comparison) {
  Paragraph paragraph;
  for (const std::string& unit : unknown_power(comparison.runs)) {
    paragraph.lines.push_back(fmt::format(
        "energy -: nobody knows what {} draws; give it with --set {}.active_w=W.", unit, unit));
  }
  for (const std::string& line : reason_lines(comparison.skipped)) {
    paragraph.lines.push_back("Not run: " + line);
  }
  return paragraph;
}

Paragraph warnings_of(const std::vector<RunRecord>& runs) {
  Paragraph paragraph;
  for (const RunRecord& run : runs) {
    for (const std::string& warning : run.warnings) {
      const std::string line = "Note: " + warning;
      if (std::ranges::find(paragraph.lines, line) == paragraph.lines.end()) {
        paragraph.lines.push_back(line);
      }
    }
  }
  return paragraph;
}

Document comparison_document(const ModeRuns& comparison, const Mix& mix, bool details) {
  Document document{.title = "pirt schedule --compare", .parts = {}};
  document.parts.emplace_back(Paragraph{answer_of(comparison).lines()});
  if (!comparison.runs.empty()) {
    const RunRecord& run = comparison.runs.front();
    Paragraph header{{fmt::format("Mix {} on platform {}, {} time, seed {}", run.mix, run.platform,
                                  run.time, run.seed)}};
    if (run.assumptions) header.lines.push_back(*run.assumptions);
    document.parts.emplace_back(std::move(header));
  }
  for (Table& table : answer_tables(comparison.runs)) document.parts.emplace_back(std::move(table));
  if (details) document.parts.emplace_back(table_of(comparison));
  for (Paragraph lines :
       {missing_of(comparison), starvation(comparison, mix), warnings_of(comparison.runs)}) {
    if (!lines.lines.empty()) document.parts.emplace_back(std::move(lines));
  }
  return document;
}

Json comparison_json(const ModeRuns& comparison) {
  auto runs = Json::array();
  for (const auto& run : comparison.runs) runs.push_back(to_json(run));
  auto skipped = Json::array();
  for (const auto& each : comparison.skipped) {
    skipped.push_back({{"mode", each.mode}, {"reason", each.reason}});
  }
  const ModeAnswer answer = answer_of(comparison);
  return {{"schema_version", RunRecord::kSchemaVersion},
          {"answer",
           {{"modes", answer.modes}, {"sentence", answer.sentence}, {"doubts", answer.doubts}}},
          {"runs", runs},
          {"skipped", skipped}};
}

}  // namespace pirt
