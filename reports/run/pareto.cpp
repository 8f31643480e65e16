#include "reports/run/pareto.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "reports/document/figures.h"
#include "reports/run/answer.h"
#include "reports/run/comparison_report.h"
#include "reports/run/run_report.h"
#include "scheduler/record/interval.h"
#include "scheduler/record/keeping_up.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr const char* kBest = "beaten by nobody";
constexpr const char* kBeaten = "another mode is as good in all, better in some";

/// In rate, energy or tail, where the two can be told apart.
bool is_better(const ModePoint& a, const ModePoint& b) {
  const auto apart = [&](const char* figure) { return !cannot_tell(*a.run, *b.run, figure); };
  return (a.rate_per_ms > b.rate_per_ms && apart("throughput_per_ms")) ||
         (a.energy_mj < b.energy_mj && apart("energy_j")) ||
         (a.tail < b.tail && !same_tail(*a.run, *b.run));
}

bool beats(const ModePoint& a, const ModePoint& b) { return is_better(a, b) && !is_better(b, a); }

/// Why @p run is no point among @p runs; empty if it is one.
std::string why_left_out(const RunRecord& run, std::span<const RunRecord> runs) {
  const auto compares = [&](const RunRecord& each) { return comparable(each, runs.front()); };
  const auto serves = [&](const RunRecord& each) { return compares(each) && keeps_up(each); };
  if (!compares(run)) return "it is not comparable with the first";
  if (!keeps_up(run) && std::ranges::any_of(runs, serves)) return "it does not keep up";
  if (run.completed == 0 || !run.throughput_per_ms || !tail_of(run, runs)) {
    return "no firing completed";
  }
  return energy_mj(run) ? "" : "its energy is not known";
}

/// Runs that are no points, by their goals.
std::vector<ModeRuns::Skipped> left_out(std::span<const RunRecord> runs) {
  std::vector<ModeRuns::Skipped> found;
  for (const RunRecord& run : runs) {
    if (auto why = why_left_out(run, runs); !why.empty()) {
      found.push_back({goal_of(run), std::move(why)});
    }
  }
  return found;
}

Origin provenance_of(const RunRecord& run) {
  const RunMarks marks = marks_of(run);
  return weakest(marks.time, marks.energy);
}

std::string front_text(const ModePoint& point) {
  return point.beaten_by == nullptr ? "nobody" : point.beaten_by->mode;
}

std::string tail_label(const std::vector<ModePoint>& points) {
  const bool deadlines = std::ranges::any_of(
      points, [](const ModePoint& point) { return p99_of_deadline(*point.run).has_value(); });
  return deadlines ? "p99 / deadline" : "p99 / least p99";
}

/// The points that no other beats in these two figures, as a line from left to right. @param
/// better  Whether a second figure is better than another.
template <typename Second, typename Better>
ReferenceLine front(const std::vector<ModePoint>& points, const Second& second,
                    const Better& better) {
  auto sorted = points;
  std::ranges::sort(sorted, [&](const ModePoint& a, const ModePoint& b) {
    return a.energy_mj != b.energy_mj ? a.energy_mj < b.energy_mj : better(second(a), second(b));
  });
  ReferenceLine line{.label = ""};
  for (const ModePoint& point : sorted) {
    if (line.points.empty() || better(second(point), line.points.back().second)) {
      line.points.emplace_back(point.energy_mj, second(point));
    }
  }
  return line;
}

std::optional<double> bound_mj(const RunRecord& run) {
  if (!run.bounds || !run.bounds->energy_j || run.completed == 0) return std::nullopt;
  return *run.bounds->energy_j * 1e3 / static_cast<double>(run.completed);
}

std::optional<double> lesser(std::optional<double> a, std::optional<double> b) {
  return a && b ? std::min(*a, *b) : a ? a : b;
}

std::optional<double> least_mj(const std::vector<ModePoint>& points) {
  std::optional<double> least;
  for (const ModePoint& point : points) least = lesser(least, bound_mj(*point.run));
  return least;
}

std::optional<double> most_rate(const std::vector<ModePoint>& points) {
  std::optional<double> most;
  for (const ModePoint& point : points) {
    if (!point.run->bounds || !point.run->bounds->throughput_per_ms) continue;
    most = std::max(most.value_or(0), *point.run->bounds->throughput_per_ms);
  }
  return most;
}

Mark mark_of(const ModePoint& point, double y) {
  return {.group = point.run->mode,
          .series = point.beaten_by == nullptr ? kBest : kBeaten,
          .x = point.energy_mj,
          .y = y,
          .provenance = provenance_of(*point.run)};
}

/// That of the runs that have one, where it is the same; else absent.
template <typename T>
std::optional<T> common(const std::vector<ModePoint>& points, std::optional<T> RunRecord::*value) {
  std::optional<T> found;
  for (const ModePoint& point : points) {
    const std::optional<T>& its = point.run->*value;
    if (found && its && *found != *its) return std::nullopt;
    if (its) found = its;
  }
  return found;
}

/// What makes the points again.
std::string points_command(const std::vector<ModePoint>& points) {
  const RunRecord& first = *points.front().run;
  const auto is_same = [&](auto RunRecord::*value) {
    return std::ranges::all_of(
        points, [&](const ModePoint& point) { return point.run->*value == first.*value; });
  };
  std::vector<std::string> modes;
  for (const ModePoint& point : points) {
    if (std::ranges::find(modes, point.run->mode) == modes.end()) modes.push_back(point.run->mode);
  }
  RunRecord asked;  // For, of all of them.
  asked.basic = common(points, &RunRecord::basic);
  asked.objective = common(points, &RunRecord::objective);
  asked.min_rate_per_ms = common(points, &RunRecord::min_rate_per_ms);
  asked.power_cap_w = common(points, &RunRecord::power_cap_w);
  asked.overflow = common(points, &RunRecord::overflow);
  // Where they differ, each has as many as its mode or its platform wants.
  if (is_same(&RunRecord::in_flight)) asked.in_flight = first.in_flight;
  if (is_same(&RunRecord::slices)) asked.slices = first.slices;
  return compare_command(first, join(modes, ",")) + flags_of(asked);
}

Chart rate_chart(const std::vector<ModePoint>& points) {
  const RunRecord& first = *points.front().run;
  Chart chart{.kind = ChartKind::kScatter,
              .x = {"mJ a task"},
              .y = {"tasks a ms"},
              .series = {kBest, kBeaten}};
  chart.table = {
      .title = fmt::format("Modes: rate and energy, mix {} on {}", first.mix, first.platform),
      .columns = {{"mode", Align::kLeft},
                  {"tasks/ms"},
                  {"rate gap %"},
                  {"mJ/task"},
                  {"energy gap %"},
                  {"beaten by", Align::kLeft}},
      .footnotes =
          {"gap = reached / bound - 1, to the most tasks a ms, and, a task, to the least energy "
           "for what the mode with most tasks completed, which no scheduler can beat. "
           "beaten by: in rate, energy and p99 from firing to completion, as far as the two can be "
           "told apart.",
           std::string(provenance_legend())},
      .origin = points_command(points)};
  for (const ModePoint& point : points) {
    const RunBounds bounds = point.run->bounds.value_or(RunBounds{});
    const RunMarks marks = marks_of(*point.run);
    chart.table.rows.push_back({point.run->mode, shown(point.rate_per_ms, marks.time),
                                gap_text(point.rate_per_ms, bounds.throughput_per_ms),
                                shown(point.energy_mj, marks.energy),
                                gap_text(point.energy_mj, least_mj(points)), front_text(point)});
    chart.marks.push_back(mark_of(point, point.rate_per_ms));
  }
  chart.lines = {front(
      points, [](const ModePoint& p) { return p.rate_per_ms; }, std::greater<>())};
  if (const auto most = most_rate(points)) chart.lines.push_back({.label = "bound", .y = most});
  if (const auto least = least_mj(points)) {
    chart.lines.push_back({.label = "bound", .x = least});
  }
  const auto best = std::ranges::count(points, nullptr, &ModePoint::beaten_by);
  chart.summary = fmt::format(
      "Up and left is better; dashed: the front, and what no scheduler can "
      "beat. {} of {} modes are beaten by nobody in rate, energy and "
      "latency together.",
      best, points.size());
  return chart;
}

Chart latency_chart(const std::vector<ModePoint>& points) {
  const RunRecord& first = *points.front().run;
  Chart chart{.kind = ChartKind::kScatter,
              .summary = "Down and left is better; dashed: the front, and the least energy.",
              .x = {"mJ a task"},
              .y = {tail_label(points), true},
              .series = {kBest, kBeaten}};
  chart.table = {
      .title = fmt::format("Modes: latency and energy, mix {} on {}", first.mix, first.platform),
      .columns = {{"mode", Align::kLeft},
                  {tail_label(points)},
                  {"task mean ms"},
                  {"mJ/task"},
                  {"late"},
                  {"dropped"},
                  {"queued"},
                  {"offloaded"}},
      .footnotes = {"p99 from firing to completion. late: firings past their "
                    "deadline. A mode that drops or offloads has less to serve.",
                    std::string(provenance_legend())},
      .origin = points_command(points)};
  for (const ModePoint& point : points) {
    const RunRecord& run = *point.run;
    const RunMarks marks = marks_of(run);
    chart.table.rows.push_back(
        {run.mode, shown(point.tail, marks.time), shown(run.mean_latency_ms, marks.time),
         shown(point.energy_mj, marks.energy), fmt::format("{}", deadline_misses(run)),
         fmt::format("{}", dropped_tasks(run)), fmt::format("{}", run.queued),
         fmt::format("{}", run.offloaded)});
    chart.marks.push_back(mark_of(point, point.tail));
  }
  chart.lines = {front(
      points, [](const ModePoint& p) { return p.tail; }, std::less<>())};
  if (const auto least = least_mj(points)) {
    chart.lines.push_back({.label = "bound", .x = least});
  }
  return chart;
}

/// Equal rows are one.
void add_row(std::vector<std::string> row, Table& table) {
  const auto same = std::ranges::find_if(table.rows, [&row](const std::vector<std::string>& other) {
    return std::equal(row.begin() + 1, row.end(), other.begin() + 1);
  });
  if (same == table.rows.end()) {
    table.rows.push_back(std::move(row));
  } else {
    same->front() += " = " + row.front();
  }
}

Table frontier_table(const std::vector<ModePoint>& points) {
  Table table{.title = "What can be had",
              .columns = {{"mode, goal", Align::kLeft},
                          {"tasks/ms"},
                          {"rate gap %"},
                          {"mJ/task"},
                          {"energy gap %"},
                          {tail_label(points)},
                          {"late"},
                          {"beaten by", Align::kLeft}}};
  for (const ModePoint& point : points) {
    const RunBounds bounds = point.run->bounds.value_or(RunBounds{});
    const RunMarks marks = marks_of(*point.run);
    std::vector<std::string> row(
        {goal_of(*point.run), shown(point.rate_per_ms, marks.time),
         gap_text(point.rate_per_ms, bounds.throughput_per_ms),
         shown(point.energy_mj, marks.energy), gap_text(point.energy_mj, least_mj(points)),
         shown(point.tail, marks.time), fmt::format("{}", deadline_misses(*point.run)),
         point.beaten_by == nullptr ? "nobody" : goal_of(*point.beaten_by)});
    add_row(std::move(row), table);
  }
  if (const auto most = most_rate(points)) {
    table.footnotes.push_back(
        fmt::format("No scheduler completes more than {} tasks a ms.", figure(*most)));
  }
  table.footnotes.emplace_back(
      "gap = reached / bound - 1; energy: a task, to the least for what any of these completed. "
      "p99 from firing to completion. beaten by: as good in rate, energy and p99, and "
      "better in one, as far as the two can be told apart.");
  table.footnotes.emplace_back(provenance_legend());
  return table;
}

}  // namespace

std::optional<double> energy_mj(const RunRecord& run) {
  if (!run.energy_j || run.completed == 0) return std::nullopt;
  return *run.energy_j * 1e3 / static_cast<double>(run.completed);
}

std::optional<double> least_energy_mj(std::span<const RunRecord> runs) {
  std::optional<double> least;
  for (const RunRecord& run : runs) least = lesser(least, bound_mj(run));
  return least;
}

std::vector<ModePoint> mode_points(std::span<const RunRecord> runs) {
  std::vector<ModePoint> points;
  for (const RunRecord& run : runs) {
    if (!why_left_out(run, runs).empty()) continue;
    points.push_back({.run = &run,
                      .rate_per_ms = *run.throughput_per_ms,
                      .energy_mj = *energy_mj(run),
                      .tail = *tail_of(run, runs)});
  }
  for (ModePoint& point : points) {
    const auto better =
        std::ranges::find_if(points, [&](const ModePoint& other) { return beats(other, point); });
    if (better != points.end()) point.beaten_by = better->run;
  }
  return points;
}

std::vector<Chart> pareto_charts(const std::vector<ModePoint>& points) {
  if (points.empty()) return {};
  return {rate_chart(points), latency_chart(points)};
}

Document pareto_document(const ModeRuns& frontier) {
  Document document{.title = "pirt schedule --pareto", .parts = {}};
  if (!frontier.runs.empty()) {
    const RunRecord& first = frontier.runs.front();
    document.parts.emplace_back(
        Paragraph{{fmt::format("Mix {} on platform {}, {} time, seed {}", first.mix, first.platform,
                               first.time, first.seed)}});
  }
  const auto points = mode_points(frontier.runs);
  if (!points.empty()) document.parts.emplace_back(frontier_table(points));
  Paragraph missing = missing_of(frontier);
  for (const std::string& line : reason_lines(left_out(frontier.runs))) {
    missing.lines.push_back("Not shown: " + line);
  }
  for (Paragraph lines : {missing, warnings_of(frontier.runs)}) {
    if (!lines.lines.empty()) document.parts.emplace_back(std::move(lines));
  }
  return document;
}

Json pareto_json(const ModeRuns& frontier) {
  const auto points = mode_points(frontier.runs);
  auto json = Json::array();
  for (const ModePoint& point : points) {
    const RunRecord& run = *point.run;
    Json each = {{"goal", goal_of(run)},
                 {"mode", run.mode},
                 {"rate_per_ms", point.rate_per_ms},
                 {"energy_mj", point.energy_mj},
                 {"tail", point.tail},
                 {"p99_latency_ms", *run.p99_latency_ms},
                 {"on_the_frontier", point.beaten_by == nullptr}};
    if (point.beaten_by != nullptr) each["beaten_by"] = goal_of(*point.beaten_by);
    if (run.in_flight) each["in_flight"] = *run.in_flight;
    each.put("least_energy_mj", bound_mj(run));
    json.push_back(std::move(each));
  }
  auto others = Json::array();
  for (const auto& runs : {frontier.skipped, left_out(frontier.runs)}) {
    for (const auto& [goal, reason] : runs) others.push_back({{"goal", goal}, {"reason", reason}});
  }
  Json result = {{"schema_version", 1}, {"points", json}, {"left_out", others}};
  if (const auto most = most_rate(points)) result["bounds"] = {{"throughput_per_ms", *most}};
  return result;
}

Json pareto_json(const std::vector<ModePoint>& points) {
  auto json = Json::array();
  for (const ModePoint& point : points) {
    json.push_back({{"mode", point.run->mode},
                    {"rate_per_ms", point.rate_per_ms},
                    {"energy_mj", point.energy_mj},
                    {"tail", point.tail},
                    {"p99_latency_ms", *point.run->p99_latency_ms}});
    if (point.beaten_by != nullptr) json.back()["beaten_by"] = point.beaten_by->mode;
  }
  return json;
}

}  // namespace pirt
