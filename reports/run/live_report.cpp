#include "reports/run/live_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <tuple>

#include "reports/document/figures.h"
#include "reports/run/live_terms.h"
#include "reports/run/run_report.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// A pipeline's figure in both runs.
struct PipelineFigure {
  const char* name;
  const char* unit;
  const char* key;
  std::optional<double> PipelineResult::*value;
};
constexpr PipelineFigure kPipelineFigures[] = {{"rate", "Hz", "rate_hz", &PipelineResult::rate_hz},
                                               {"p50", "ms", "p50_ms", &PipelineResult::p50_ms},
                                               {"p95", "ms", "p95_ms", &PipelineResult::p95_ms}};

std::string name_of(const RunRecord& run) {
  return fmt::format("mode {}, mix {} on {}",
                     run.basic ? run.mode + " over " + *run.basic : run.mode, run.mix,
                     run.platform);
}

/// What makes the prediction that is missing.
std::string command_of(const RunRecord& live) {
  return fmt::format("pirt schedule --mode {}{}{} --seed {} --json virtual.json", live.mode,
                     scenario_flags(live), flags_of(live), live.seed);
}

/// "virtual time, its samples drawn".
std::string name_of_prediction(const RunRecord& run) {
  const auto draw = run.draw.value_or("median");
  return "virtual time" + (draw == "median" ? "" : ", " + draw + " of the profile");
}

Chart pipeline_chart(const RunRecord& live, const RunRecord& predicted) {
  const Origin measured = marks_of(live).time, computed = marks_of(predicted).time;
  Chart chart{.kind = ChartKind::kDots, .x = {"virtual time is off by, % of the live run"}};
  chart.table = {
      .title = fmt::format("Pipelines, live beside {}: {}", name_of_prediction(predicted),
                           name_of(live)),
      .columns = {{"pipeline", Align::kLeft},
                  {"figure", Align::kLeft},
                  {"live"},
                  {"virtual"},
                  {"off by, %"}},
      .footnotes = {"off by: virtual / live - 1. p50, p95: firing to the completion of its last "
                    "task.",
                    std::string(provenance_legend())}};
  for (const PipelineResult& pipeline : live.pipelines) {
    const PipelineResult* other = predicted.find_pipeline(pipeline.pipeline);
    for (const PipelineFigure& what : kPipelineFigures) {
      chart.series.emplace_back(what.name);
      const auto there = pipeline.*what.value;
      const auto here = other == nullptr ? std::nullopt : other->*what.value;
      const auto error = gap(here, there);
      chart.table.rows.push_back({pipeline.pipeline, fmt::format("{} {}", what.name, what.unit),
                                  shown(there, measured), shown(here, computed),
                                  gap_text(here, there)});
      Mark mark{.group = pipeline.pipeline, .series = what.name, .provenance = computed};
      if (error) {
        mark.x = 100 * *error;
      } else {
        mark.word = "not in both";
      }
      chart.marks.push_back(std::move(mark));
    }
  }
  std::ranges::sort(chart.series);
  // Not std::ranges: clang 14 does not compile the subrange of this libstdc++.
  chart.series.erase(std::unique(chart.series.begin(), chart.series.end()), chart.series.end());
  chart.summary =
      fmt::format("How far virtual time is off for {} pipelines.", live.pipelines.size());
  return chart;
}

Table units_table(const RunRecord& live, const RunRecord& predicted) {
  Table table{.title = fmt::format("Units, live beside {}: {}", name_of_prediction(predicted),
                                   name_of(live)),
              .columns = {{"unit", Align::kLeft},
                          {"tasks live"},
                          {"virtual"},
                          {"busy % live"},
                          {"virtual"},
                          {"off by, points"}},
              .footnotes = {std::string(provenance_legend())}};
  for (const UnitResult& unit : live.units) {
    const UnitResult* other = predicted.find_unit(unit.unit);
    const auto percent = [](const std::optional<double>& part) {
      return part ? std::optional(100 * *part) : std::nullopt;
    };
    const auto there = percent(unit.utilization);
    const auto here = other == nullptr ? std::nullopt : percent(other->utilization);
    table.rows.push_back({unit.unit, fmt::format("{}", unit.completed),
                          other == nullptr ? "-" : fmt::format("{}", other->completed),
                          shown(there, time_of(live, unit)),
                          other == nullptr ? "-" : shown(here, time_of(predicted, *other)),
                          there && here ? fmt::format("{:+.1f}", *here - *there) : "-"});
  }
  return table;
}

std::string found_text(RowFinding finding) {
  const std::string word(to_string(finding));
  return finding == RowFinding::kContradicted ? "✗ " + word : word;
}

Table rows_table(const RunRecord& live, const Profile* profile, const std::vector<RowCheck>& rows) {
  const auto contradicted = std::ranges::count(rows, RowFinding::kContradicted, &RowCheck::finding);
  Table table{
      .title = fmt::format("Rows of the profile that the live run contradicts: {} of {}, {}",
                           contradicted, rows.size(), name_of(live)),
      .columns = {{"workload", Align::kLeft},
                  {"unit", Align::kLeft},
                  {"row: median ms"},
                  {"interval ms"},
                  {"live: calls"},
                  {"p50 ms"},
                  {"p95 ms"},
                  {"live / row"},
                  {"found", Align::kLeft},
                  {"explained by", Align::kLeft}},
      .footnotes = {fmt::format("contradicted: the live median is more than {:.0f} % outside the "
                                "95 % interval of the row's; of fewer than {} calls nothing is "
                                "said. A call is upload, execute and download. own clock: the row "
                                "is by the unit's own clock, the live run by this machine's.",
                                100 * kSameMedian, kFewestCalls)},
      .origin = profile == nullptr ? "" : profile->path};
  for (const RowCheck& row : rows) {
    const auto ratio = gap(row.live.p50_ms, row.median_ms);
    table.rows.push_back(
        {row.live.workload, row.live.unit, figure(row.median_ms),
         row.low_ms && row.high_ms ? figure(row.low_ms) + " to " + figure(row.high_ms) : "-",
         fmt::format("{}", row.live.completed), figure(row.live.p50_ms), figure(row.live.p95_ms),
         ratio ? fmt::format("{:.2f}x", 1 + *ratio) : "-", found_text(row.finding),
         profile == nullptr ? "" : explanation_of(row, *profile)});
  }
  return table;
}

std::vector<std::string> left_out(const RunRecord& live, const Profile* profile) {
  std::vector<std::string> lines = {left_out_of_prediction(profile)};
  if (live.set_up_s) {
    lines.push_back(fmt::format(
        "Devices and kernels took {} s before the first firing, which "
        "neither counts{}.",
        figure(*live.set_up_s),
        live.first_call_ms ? fmt::format("; the first call took {} ms", figure(*live.first_call_ms))
                           : ""));
  }
  return lines;
}

const Profile* profile_of(const RunRecord& run, std::span<const Profile* const> profiles) {
  const auto found = std::ranges::find_if(profiles, [&](const Profile* profile) {
    return profile != nullptr && profile->platform() == run.platform;
  });
  return found == profiles.end() ? nullptr : *found;
}

RowCheck check_row(const CallResult& call, const UnitResult& unit, const Profile* profile) {
  RowCheck check{.live = call};
  const PhaseRow* row =
      profile == nullptr ? nullptr : profile->find(call.workload, call.unit, Phase::kCall);
  if (row == nullptr || !is_used(*row) || !row->median || !row->ci_low || !row->ci_high)
    return check;
  check.median_ms = to_ms(*row->median);
  check.low_ms = to_ms(*row->ci_low);
  check.high_ms = to_ms(*row->ci_high);
  const bool outside = call.p50_ms < *check.low_ms / (1 + kSameMedian) ||
                       call.p50_ms > *check.high_ms * (1 + kSameMedian);
  check.finding = unit.own_clock.value_or(false)  ? RowFinding::kOwnClock
                  : call.completed < kFewestCalls ? RowFinding::kTooFewCalls
                  : outside                       ? RowFinding::kContradicted
                                                  : RowFinding::kAgrees;
  return check;
}

Json pair_json(const RunRecord& live, const RunRecord& predicted) {
  Json json = {{"draw", predicted.draw.value_or("median")},
               {"seed", predicted.seed},
               {"pipelines", Json::object()},
               {"units", Json::object()}};
  for (const PipelineResult& pipeline : live.pipelines) {
    const PipelineResult* other = predicted.find_pipeline(pipeline.pipeline);
    if (other == nullptr) continue;
    Json& errors = json["pipelines"][pipeline.pipeline] = Json::object();
    for (const PipelineFigure& what : kPipelineFigures) {
      errors.put((std::string(what.key) + "_error").c_str(),
                 gap(other->*what.value, pipeline.*what.value));
    }
  }
  for (const UnitResult& unit : live.units) {
    const UnitResult* other = predicted.find_unit(unit.unit);
    if (other == nullptr || !unit.utilization || !other->utilization) continue;
    json["units"][unit.unit] = {{"utilization_error", *other->utilization - *unit.utilization}};
  }
  return json;
}

Json row_json(const RowCheck& row, const Profile* profile) {
  Json json = {{"workload", row.live.workload},  {"unit", row.live.unit},
               {"calls", row.live.completed},    {"live_p50_ms", row.live.p50_ms},
               {"live_p95_ms", row.live.p95_ms}, {"finding", to_string(row.finding)}};
  json.put("median_ms", row.median_ms);
  json.put("ci_low_ms", row.low_ms);
  json.put("ci_high_ms", row.high_ms);
  if (profile != nullptr) {
    if (auto why = explanation_of(row, *profile); !why.empty()) json["explained_by"] = why;
  }
  return json;
}

}  // namespace

std::string_view to_string(RowFinding finding) {
  switch (finding) {
    case RowFinding::kAgrees:
      return "agrees";
    case RowFinding::kContradicted:
      return "contradicted";
    case RowFinding::kTooFewCalls:
      return "too few calls";
    case RowFinding::kOwnClock:
      return "own clock";
    case RowFinding::kNoRow:
      return "no valid row";
  }
  return "";
}

std::vector<LiveRun> live_runs(std::span<const RunRecord> runs) {
  const auto what = [](const RunRecord& run) {
    return std::tie(run.mode, run.basic, run.mix, run.duration_s, run.in_flight, run.objective,
                    run.min_rate_per_ms, run.power_cap_w, run.overflow);
  };
  // A database may have got more rows since, and a copy lies elsewhere.
  const auto of_another_profile = [](const RunRecord& a, const RunRecord& b) {
    return a.profile_hash && b.profile_hash && a.profile_hash != b.profile_hash &&
           a.profile_file != b.profile_file;
  };
  std::vector<LiveRun> found;
  for (const RunRecord& live : runs) {
    if (!live.is_live()) continue;
    LiveRun each{.live = &live, .predictions = {}};
    for (const RunRecord& run : runs) {
      if (run.is_live() || what(run) != what(live) || !on_same_machine(run, live)) continue;
      if (!of_another_profile(run, live)) each.predictions.push_back(&run);
    }
    found.push_back(std::move(each));
  }
  return found;
}

std::vector<RowCheck> check_rows(const RunRecord& live, const Profile* profile) {
  std::vector<RowCheck> checks;
  for (const CallResult& call : live.calls) {
    const UnitResult* unit = live.find_unit(call.unit);
    if (unit != nullptr && unit->backend) checks.push_back(check_row(call, *unit, profile));
  }
  return checks;
}

std::vector<Part> live_parts(std::span<const RunRecord> runs,
                             std::span<const Profile* const> profiles) {
  std::vector<Part> parts;
  const auto found = live_runs(runs);
  if (!found.empty()) parts.emplace_back(Heading{"Live beside virtual time"});
  for (const LiveRun& each : found) {
    const RunRecord& live = *each.live;
    if (each.predictions.empty()) {
      parts.emplace_back(Paragraph{{fmt::format(
          "There is no run in virtual time of {} to compare the live one with; this makes it: {}",
          name_of(live), command_of(live))}});
    }
    for (const RunRecord* predicted : each.predictions) {
      parts.emplace_back(pipeline_chart(live, *predicted));
      parts.emplace_back(units_table(live, *predicted));
    }
    const Profile* profile = profile_of(live, profiles);
    const auto rows = check_rows(live, profile);
    if (!rows.empty()) parts.emplace_back(rows_table(live, profile, rows));
    parts.emplace_back(Paragraph{left_out(live, profile)});
  }
  return parts;
}

Json live_json(std::span<const RunRecord> runs, std::span<const Profile* const> profiles) {
  Json json = Json::array();
  for (const LiveRun& each : live_runs(runs)) {
    const RunRecord& live = *each.live;
    Json one = {{"mode", live.mode},
                {"mix", live.mix},
                {"platform", live.platform},
                {"predictions", Json::array()},
                {"rows", Json::array()}};
    for (const RunRecord* predicted : each.predictions) {
      one["predictions"].push_back(pair_json(live, *predicted));
    }
    const Profile* profile = profile_of(live, profiles);
    for (const RowCheck& row : check_rows(live, profile)) {
      one["rows"].push_back(row_json(row, profile));
    }
    json.push_back(std::move(one));
  }
  return json;
}

}  // namespace pirt
