#include "reports/gate/gate_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <map>

#include "reports/document/figures.h"
#include "scheduler/schedule.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/markup.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr std::array kVerdicts = {GateVerdict::kFailed,       GateVerdict::kSlower,
                                  GateVerdict::kInconclusive, GateVerdict::kNotComparable,
                                  GateVerdict::kUndecided,    GateVerdict::kFaster,
                                  GateVerdict::kSame,         GateVerdict::kNotJudged};

std::string percent_text(std::optional<double> value) {
  return value ? fmt::format("{:+.1f}", 100 * *value) : "-";
}

bool quiet(const GateRow& row) {
  return row.verdict == GateVerdict::kSame || row.verdict == GateVerdict::kNotJudged;
}

/// Nanoseconds as milliseconds, shares in percent; others as they are.
std::string value_text(const GateRow& row, std::optional<double> value) {
  if (!value) return "-";
  if (row.measure == "ns") return figure(*value * 1e-6);
  return figure(row.measure == "share" ? *value * 100 : *value);
}

std::string measure_text(const GateRow& row) {
  return row.measure == "ns" ? "ms" : row.measure == "share" ? "%" : row.measure;
}

/// "45 not judged (36 of set-up)": they block nothing, and are counted apart.
std::string not_judged_text(const GateResult& result) {
  const auto setups = std::ranges::count_if(result.rows, [](const GateRow& row) {
    return row.verdict == GateVerdict::kNotJudged && row.setup;
  });
  const auto all = result.count(GateVerdict::kNotJudged);
  return setups > 0 ? fmt::format("{} not judged ({} of set-up)", all, setups)
                    : fmt::format("{} not judged", all);
}

std::string answer_text(const GateReport& report) {
  const GateResult& result = report.result;
  const int code = exit_code_of(result, report.strict);
  if (code == kExitCheckFailed) return "REGRESSION";
  if (code == kExitInconclusive) return "INCONCLUSIVE";
  const auto undecided = result.count(GateVerdict::kUndecided);
  if (undecided == 0) return "no regression";
  const auto judged = std::ssize(result.rows) - result.count(GateVerdict::kNotJudged);
  return fmt::format("UNDECIDED in {} of {} rows, none slower", undecided, judged);
}

Paragraph verdict_line(const GateReport& report) {
  const GateResult& result = report.result;
  std::vector<std::string> counts;
  for (const GateVerdict verdict : kVerdicts) {
    const auto count = result.count(verdict);
    if (count == 0) continue;
    counts.push_back(verdict == GateVerdict::kNotJudged
                         ? not_judged_text(result)
                         : fmt::format("{} {}", count, to_string(verdict)));
  }
  Paragraph lines{
      {fmt::format("{}: {} against {}", answer_text(report), report.candidate, report.base),
       fmt::format("{} rows: {}", result.rows.size(), fmt::join(counts, ", "))}};
  if (!report.anchor.empty()) lines.lines[0] += " and against the anchor " + report.anchor;
  lines.lines.insert(lines.lines.end(), report.notes.begin(), report.notes.end());
  return lines;
}

/// Of a tail, in points; it has no ratio.
std::optional<double> change_of(const GateRow& row) {
  return row.ratio ? std::optional(*row.ratio - 1) : row.change;
}

Table rows_table(const GateReport& report, bool all) {
  Table table{.title = "Rows",
              .columns = {{"workload", Align::kLeft},
                          {"unit", Align::kLeft},
                          {"phase", Align::kLeft},
                          {"verdict", Align::kLeft},
                          {"base"},
                          {"candidate"},
                          {"in", Align::kLeft},
                          {"change %"},
                          {"needed %"},
                          {"p"},
                          {"why", Align::kLeft}}};
  for (const GateVerdict verdict : kVerdicts) {
    for (const auto& row : report.result.rows) {
      if (row.verdict != verdict || (quiet(row) && !all)) continue;
      table.rows.push_back(
          {row.workload, row.unit, row.phase + (row.against_anchor ? ", against the anchor" : ""),
           std::string(to_string(verdict)), value_text(row, row.base),
           value_text(row, row.candidate), measure_text(row), percent_text(change_of(row)),
           row.needed ? fmt::format("{:.1f}", 100 * *row.needed) : "-",
           row.p ? fmt::format("{:.2g}", *row.p) : "-", row.reason.empty() ? "-" : row.reason});
    }
  }
  table.footnotes = report.rule;
  return table;
}

Table flips_table(const Decisions& decisions) {
  Table table{.title = "Preferable units that changed",
              .columns = {{"workload", Align::kLeft},
                          {"by", Align::kLeft},
                          {"base", Align::kLeft},
                          {"candidate", Align::kLeft},
                          {"how sure", Align::kLeft}}};
  for (const Flip& flip : decisions.flips) {
    table.rows.push_back(
        {flip.workload, flip.by, flip.base, flip.candidate,
         flip.clear ? "the units' intervals are apart, before and after" : "not sure"});
  }
  return table;
}

/// "12.3 -> 12.9 (+4.9 %)".
std::string change_text(std::optional<double> base, std::optional<double> candidate) {
  if (!base || !candidate) return "-";
  const std::string change =
      *base > 0 ? fmt::format(" ({:+.1f} %)", 100 * (*candidate / *base - 1)) : "";
  return figure(*base) + " -> " + figure(*candidate) + change;
}

std::int64_t misses_of(const RunRecord& run) {
  std::int64_t misses = 0;
  for (const auto& pipeline : run.pipelines) misses += pipeline.deadline_misses.value_or(0);
  return misses;
}

std::vector<std::string> reasons_without_cost(const std::vector<ModeCost>& modes) {
  std::vector<ModeRuns::Skipped> skipped;
  for (const ModeCost& cost : modes) {
    if (!cost.base || !cost.candidate) skipped.push_back({cost.mode, cost.reason});
  }
  return reason_lines(skipped);
}

/// What the mix costs, or, if that is known in no mode, why.
Part modes_part(const Decisions& decisions) {
  std::vector<std::string> reasons = reasons_without_cost(decisions.modes);
  Table table{.title = "What mix " + decisions.mix + " costs in each mode",
              .columns = {{"mode", Align::kLeft},
                          {"mean latency ms"},
                          {"p99 latency ms"},
                          {"energy J"},
                          {"deadline misses"},
                          {"dropped"}},
              .footnotes = reasons};
  for (const ModeCost& cost : decisions.modes) {
    if (!cost.base || !cost.candidate) continue;
    const RunRecord& a = *cost.base;
    const RunRecord& b = *cost.candidate;
    table.rows.push_back({cost.mode, change_text(a.mean_latency_ms, b.mean_latency_ms),
                          change_text(a.p99_latency_ms, b.p99_latency_ms),
                          change_text(a.energy_j, b.energy_j),
                          fmt::format("{} -> {}", misses_of(a), misses_of(b)),
                          fmt::format("{} -> {}", a.dropped, b.dropped)});
  }
  table.footnotes.emplace_back("Virtual time on both profiles: all of it is modelled.");
  if (!table.rows.empty()) return table;
  for (std::string& reason : reasons) reason.insert(0, "No cost in ");
  return Paragraph{reasons};
}

Json row_json(const GateRow& row) {
  Json json = {{"workload", row.workload},
               {"unit", row.unit},
               {"phase", row.phase},
               {"verdict", to_string(row.verdict)}};
  const std::string suffix = row.measure == "ns" ? "_ns" : row.measure == "J" ? "_j" : "";
  if (suffix.empty()) json["measure"] = row.measure;
  if (row.against_anchor) json["against"] = "anchor";
  json.put("base" + suffix, row.base);
  json.put("candidate" + suffix, row.candidate);
  json.put("ratio", row.ratio);
  json.put("p_adjusted", row.p);
  json.put("change", row.change);
  json.put("change_at_least", row.at_least);
  json.put("change_at_most", row.at_most);
  json.put("needed", row.needed);
  if (!row.reason.empty()) json["reason"] = row.reason;
  return json;
}

Json machine_json(const std::vector<MachineShift>& machine) {
  Json shifts = Json::array();
  for (const MachineShift& each : machine) {
    shifts.push_back({{"unit", each.unit}, {"peak", to_string(each.kind)}, {"ratio", each.ratio}});
  }
  return shifts;
}

/// "cpu f32 -20.0 % and memory bandwidth -1.0 to +2.0 %; gpu ...": a range where rows are of
/// several runs. Empty if nothing was.
std::string machine_text(const std::vector<MachineShift>& machine) {
  std::map<std::string, std::map<PeakKind, std::vector<double>>> moved;
  for (const MachineShift& each : machine) moved[each.unit][each.kind].push_back(each.ratio);
  std::vector<std::string> units;
  for (const auto& [unit, kinds] : moved) {
    std::vector<std::string> peaks;
    for (const auto& [kind, ratios] : kinds) {
      const auto [least, most] = std::ranges::minmax(ratios);
      peaks.push_back(fmt::format(
          "{} {}{:+.1f} %", kind == PeakKind::kF32 ? "f32" : "memory bandwidth",
          least < most ? fmt::format("{:+.1f} to ", 100 * (least - 1)) : "", 100 * (most - 1)));
    }
    units.push_back(fmt::format("{} {}", unit, fmt::join(peaks, " and ")));
  }
  return join(units, "; ");
}

/// @param older  What the candidate was compared with.
Json identity_json(const std::vector<FactDifference>& differences, const char* older) {
  Json identity = Json::array();
  for (const auto& each : differences) {
    identity.push_back({{"fact", each.fact},
                        {older, each.a ? Json(*each.a) : Json()},
                        {"candidate", each.b ? Json(*each.b) : Json()}});
  }
  return identity;
}

Json decisions_json(const Decisions& decisions) {
  Json flips = Json::array();
  for (const Flip& flip : decisions.flips) {
    flips.push_back({{"workload", flip.workload},
                     {"by", flip.by},
                     {"base", flip.base},
                     {"candidate", flip.candidate},
                     {"clear", flip.clear}});
  }
  Json modes = Json::object();
  for (const ModeCost& cost : decisions.modes) {
    Json& mode = modes[cost.mode];
    if (!cost.base || !cost.candidate) {
      mode = {{"reason", cost.reason}};
      continue;
    }
    const auto side = [](const RunRecord& run) {
      Json json = {{"deadline_misses", misses_of(run)}, {"dropped", run.dropped}};
      json.put("mean_latency_ms", run.mean_latency_ms);
      json.put("p99_latency_ms", run.p99_latency_ms);
      json.put("energy_j", run.energy_j);
      return json;
    };
    mode = {{"base", side(*cost.base)}, {"candidate", side(*cost.candidate)}};
  }
  return {{"mix", decisions.mix}, {"flips", flips}, {"modes", modes}};
}

bool is_failure(GateVerdict verdict) {
  return verdict == GateVerdict::kSlower || verdict == GateVerdict::kFailed;
}

/// Of JUnit: without an answer.
bool is_skipped(GateVerdict verdict) {
  return !is_failure(verdict) && verdict != GateVerdict::kSame && verdict != GateVerdict::kFaster;
}

std::string message_of(const GateRow& row) {
  if (!row.reason.empty()) return row.reason;
  return fmt::format("{} -> {} {} ({} %)", value_text(row, row.base),
                     value_text(row, row.candidate), measure_text(row),
                     percent_text(change_of(row)));
}

}  // namespace

void describe_rule(const GateThresholds& thresholds, GateReport& report) {
  const GateThresholds& t = thresholds;
  report.rule = {
      fmt::format("base, candidate: medians, of a tail the share of calls over {:g} times the "
                  "base's median as the machine moved it.",
                  t.tail_multiple),
      fmt::format(
          "slower: the median rose by needed % or more ({:g} %; set-up {:g} % and {:g} ms) "
          "and the 95 % intervals over processes are half of that apart, both beyond what "
          "the unit's peaks moved by; a tail: its share by {:g} points. same: the interval "
          "of the change ends below half of that. All else is undecided, and passes but for "
          "--strict.",
          100 * t.effect, 100 * t.setup * t.effect, to_ms(t.setup_grain), 100 * t.tail_share)};
  report.rule_json = {{"effect", t.effect},
                      {"setup", t.setup},
                      {"of_call", t.of_call},
                      {"workloads", t.workloads},
                      {"together", t.together},
                      {"tail_samples", t.tail_samples},
                      {"tail_multiple", t.tail_multiple},
                      {"tail_share", t.tail_share}};
  const std::string moved = machine_text(report.result.machine);
  report.notes.push_back(
      moved.empty() ? "Taken off as the machine's: nothing, the runs have no peaks in common."
                    : "Taken off as the machine's, by its own peaks: " + moved + ".");
  const std::string of_anchor = machine_text(report.result.anchor_machine);
  if (!of_anchor.empty()) {
    report.notes.push_back("Taken off against the anchor: " + of_anchor + ".");
  }
  if (report.result.unsure.empty()) return;
  report.notes.push_back(fmt::format(
      "Slower on {} may be one run that differs from others: fewer than {} workloads tell by how "
      "much runs differ; measure each side in two runs or more (same --db), or side by side: "
      "--baseline-program.",
      fmt::join(report.result.unsure, ", "), t.workloads));
}

int exit_code_of(const GateResult& result, bool strict) {
  const auto any = [&result](GateVerdict verdict) { return result.count(verdict) > 0; };
  if (any(GateVerdict::kSlower) || any(GateVerdict::kFailed)) return kExitCheckFailed;
  const bool open = any(GateVerdict::kInconclusive) || any(GateVerdict::kNotComparable) ||
                    (strict && any(GateVerdict::kUndecided));
  return open ? kExitInconclusive : 0;
}

Document gate_document(const GateReport& report, bool all) {
  Document document{.title = "pirt regress", .parts = {}};
  document.parts.emplace_back(verdict_line(report));
  const bool any = all || std::ranges::any_of(report.result.rows,
                                              [](const GateRow& row) { return !quiet(row); });
  if (any) document.parts.emplace_back(rows_table(report, all));
  if (report.decisions) {
    if (report.decisions->flips.empty()) {
      document.parts.emplace_back(Paragraph{{"No workload's preferable unit changed."}});
    } else {
      document.parts.emplace_back(flips_table(*report.decisions));
    }
    if (!report.decisions->modes.empty()) {
      document.parts.push_back(modes_part(*report.decisions));
    }
  }
  return document;
}

Json gate_json(const GateReport& report) {
  Json rows = Json::array();
  for (const auto& row : report.result.rows) rows.push_back(row_json(row));
  Json json = {{"schema_version", 1},
               {"base", report.base},
               {"candidate", report.candidate},
               {"exit_code", exit_code_of(report.result, report.strict)},
               {"rule", report.rule_json},
               {"identity_differences", identity_json(report.result.identity, "base")},
               {"machine", machine_json(report.result.machine)},
               {"rows", rows}};
  if (!report.anchor.empty()) {
    json["anchor"] = report.anchor;
    json["anchor_identity_differences"] = identity_json(report.result.anchor_identity, "anchor");
    json["anchor_machine"] = machine_json(report.result.anchor_machine);
  }
  if (report.decisions) json["decisions"] = decisions_json(*report.decisions);
  return json;
}

std::string gate_junit(const GateReport& report) {
  std::map<std::string, std::vector<const GateRow*>> suites;  // By unit.
  for (const auto& row : report.result.rows) suites[row.unit].push_back(&row);
  std::string xml =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"pirt regress\">\n";
  for (const auto& [unit, rows] : suites) {
    const auto failures =
        std::ranges::count_if(rows, [](const GateRow* row) { return is_failure(row->verdict); });
    const auto skipped =
        std::ranges::count_if(rows, [](const GateRow* row) { return is_skipped(row->verdict); });
    xml += fmt::format(
        "  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"0\" skipped=\"{}\">\n",
        escape_markup(unit), rows.size(), failures, skipped);
    for (const GateRow* row : rows) {
      xml +=
          fmt::format("    <testcase classname=\"{}{}\" name=\"{}\"",
                      unit.empty() ? "" : escape_markup(unit) + ".", escape_markup(row->workload),
                      escape_markup(row->phase + (row->against_anchor ? " (anchor)" : "")));
      const std::string message = fmt::format("{}: {}", to_string(row->verdict), message_of(*row));
      if (is_failure(row->verdict)) {
        xml += fmt::format("><failure message=\"{}\"/></testcase>\n", escape_markup(message));
      } else if (is_skipped(row->verdict)) {
        xml += fmt::format("><skipped message=\"{}\"/></testcase>\n", escape_markup(message));
      } else {
        xml += "/>\n";
      }
    }
    xml += "  </testsuite>\n";
  }
  return xml + "</testsuites>\n";
}

}  // namespace pirt
