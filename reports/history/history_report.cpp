// What a history says, for people and programs. Declared in history.h.
#include <fmt/core.h>

#include <map>
#include <tuple>

#include "reports/document/figures.h"
#include "reports/history/history.h"
#include "workloads/base/text/shell.h"

namespace pirt {
namespace {

std::string run_text(const History& history, const HistorySeries& series, std::size_t point) {
  const HistoryRun& run = history.runs[series.points[point].run];
  return fmt::format("{} ({}, run {})", run.info.started, run.file, run.info.run_id);
}

std::string value_text(const HistorySeries& series, double value) {
  return figure(series.is_energy() ? value : value * 1e-6);
}

std::string kind_text(const HistoryChange& change) {
  if (change.kind == HistoryChange::Kind::kSuspected) return "suspected since";
  return std::string(to_string(change.kind));
}

Table changes_table(const History& history) {
  Table table{.title = "Changes",
              .columns = {{"workload", Align::kLeft},
                          {"unit", Align::kLeft},
                          {"phase", Align::kLeft},
                          {"what", Align::kLeft},
                          {"change %"},
                          {"from"},
                          {"to"},
                          {"in", Align::kLeft},
                          {"between", Align::kLeft},
                          {"and", Align::kLeft},
                          {"why", Align::kLeft}}};
  for (const HistorySeries& series : history.series) {
    for (const HistoryChange& change : series.changes) {
      if (change.kind == HistoryChange::Kind::kBreak) continue;
      table.rows.push_back(
          {series.workload, series.unit, series.phase, kind_text(change),
           fmt::format("{:+.1f}", 100 * (change.ratio - 1)),
           value_text(series, series.points[change.before].value),
           value_text(series, series.points[change.after].value), series.is_energy() ? "J" : "ms",
           run_text(history, series, change.before), run_text(history, series, change.after),
           change.why.empty() ? "-" : change.why});
    }
  }
  table.footnotes = {
      fmt::format("change: of the levels on either side; from, to: the figures of the two runs. "
                  "step: {} runs or more on either side. suspected since: fewer, which may be a "
                  "spike. creep: from the first quarter to the last, no step is half of it.",
                  kFewestOfLevel)};
  return table;
}

/// Each once, not for each row.
Paragraph breaks_of(const History& history) {
  std::map<std::tuple<std::size_t, std::string, std::string>, std::string> lines;
  for (const HistorySeries& series : history.series) {
    for (const HistoryChange& change : series.changes) {
      if (change.kind != HistoryChange::Kind::kBreak) continue;
      lines[{series.points[change.after].run, series.unit, change.why}] =
          fmt::format("Break of {} at {}: {}; nothing is said across it.", series.unit,
                      run_text(history, series, change.after), change.why);
    }
  }
  Paragraph paragraph;
  for (const auto& [key, line] : lines) paragraph.lines.push_back(line);
  return paragraph;
}

/// One of all phases of a workload on a unit over the runs.
Chart series_chart(const History& history, const std::vector<const HistorySeries*>& phases) {
  const HistorySeries& first = *phases.front();
  const bool joules = first.is_energy();
  Chart chart{.kind = ChartKind::kScatter};
  chart.summary =
      fmt::format("{} on {} over {} runs", first.workload, first.unit, history.runs.size());
  chart.x = {.label = "run", .log = false};
  chart.y = {.label = joules ? "J" : "ms", .log = true};
  chart.table = {
      .title = first.workload + " on " + first.unit + (joules ? ", energy" : ""),
      .columns = {
          {"run"}, {"started", Align::kLeft}, {"phase", Align::kLeft}, {joules ? "J" : "ms"}}};
  for (const HistorySeries* series : phases) {
    for (const HistoryPoint& point : series->points) {
      const double value = joules ? point.value : point.value * 1e-6;
      chart.table.rows.push_back({std::to_string(point.run + 1),
                                  history.runs[point.run].info.started, series->phase,
                                  figure(value) + (point.doubted ? " ?" : "")});
      chart.marks.push_back({.group = "",
                             .series = series->phase,
                             .x = static_cast<double>(point.run + 1),
                             .y = value,
                             .doubt = point.doubted ? "?" : ""});
    }
    for (const HistoryChange& change : series->changes) {
      if (change.kind == HistoryChange::Kind::kCreep) continue;
      chart.lines.push_back({.label = fmt::format("{} {} {:+.0f} %", series->phase,
                                                  to_string(change.kind), 100 * (change.ratio - 1)),
                             .x = static_cast<double>(series->points[change.after].run) + 0.5});
    }
  }
  return chart;
}

Json run_json(const HistoryRun& run) {
  return {{"file", run.file}, {"run_id", run.info.run_id}, {"started", run.info.started}};
}

}  // namespace

std::vector<std::string> left_out_lines(const History& history) {
  std::vector<std::string> lines;
  for (const HistoryRun& run : history.left_out) {
    lines.push_back(fmt::format(
        "run {} of {} did not end and is left out; go on with: pirt characterize --resume --db {}",
        run.info.run_id, run.file, path_in_shell(run.file)));
  }
  return lines;
}

Document history_document(const History& history, bool all) {
  Document document{.title = "pirt history", .parts = {}};
  std::map<HistoryChange::Kind, int> counts;
  for (const HistorySeries& series : history.series) {
    for (const HistoryChange& change : series.changes) {
      if (change.kind != HistoryChange::Kind::kBreak) ++counts[change.kind];
    }
  }
  std::string found;
  for (const auto& [kind, count] : counts) {
    found += fmt::format("{}{} {}", found.empty() ? "" : ", ", count, to_string(kind));
  }
  document.parts.emplace_back(Paragraph{
      {fmt::format("{} rows over {} runs of {}, {} to {}: {}", history.series.size(),
                   history.runs.size(), history.platform, history.runs.front().info.started,
                   history.runs.back().info.started, found.empty() ? "no change" : found)}});
  if (!found.empty()) document.parts.emplace_back(changes_table(history));
  Paragraph breaks = breaks_of(history);
  if (!breaks.lines.empty()) document.parts.emplace_back(std::move(breaks));
  if (!history.left_out.empty()) document.parts.emplace_back(Paragraph{left_out_lines(history)});
  if (!all) return document;
  std::map<std::tuple<std::string, std::string, bool>, std::vector<const HistorySeries*>> charts;
  for (const HistorySeries& series : history.series) {
    charts[{series.workload, series.unit, series.is_energy()}].push_back(&series);
  }
  for (const auto& [key, phases] : charts)
    document.parts.emplace_back(series_chart(history, phases));
  return document;
}

Json history_json(const History& history) {
  Json runs = Json::array();
  for (const HistoryRun& run : history.runs) runs.push_back(run_json(run));
  Json left_out = Json::array();
  for (const HistoryRun& run : history.left_out) left_out.push_back(run_json(run));
  Json all = Json::array();
  for (const HistorySeries& series : history.series) {
    Json points = Json::array();
    for (const HistoryPoint& point : series.points) {
      Json json = {{"run", point.run}, {"value", point.value}, {"doubted", point.doubted}};
      json.put("low", point.low);
      json.put("high", point.high);
      points.push_back(json);
    }
    Json changes = Json::array();
    for (const HistoryChange& change : series.changes) {
      Json json = {{"what", to_string(change.kind)},
                   {"between", Json::array({series.points[change.before].run,
                                            series.points[change.after].run})},
                   {"ratio", change.ratio}};
      if (!change.why.empty()) json["why"] = change.why;
      changes.push_back(json);
    }
    all.push_back({{"workload", series.workload},
                   {"unit", series.unit},
                   {"phase", series.phase},
                   {"measure", series.measure()},
                   {"points", points},
                   {"changes", changes}});
  }
  return {{"schema_version", 1},
          {"platform", history.platform},
          {"runs", runs},
          {"left_out", left_out},
          {"series", all}};
}

}  // namespace pirt
