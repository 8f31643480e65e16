#include "reports/profile/condition_report.h"

#include <fmt/core.h>

#include <algorithm>

#include "reports/document/figures.h"
#include "reports/profile/shown_row.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// What is measured; `sleep` is said of where there is one.
std::string what_text(const UnitTimeRow& row) {
  switch (row.phase) {
    case UnitPhase::kHandover:
      return row.sleep == Nanos(0)
                 ? "handing over a call behind another"
                 : "handing over a call, asleep for " + figure_ms(row.sleep) + " ms";
    case UnitPhase::kLeave:
      return "leaving a call between two slices, and on again";
    case UnitPhase::kReread:
      return row.sleep == Nanos(0) ? "reading part of the last cache again"
                                   : "reading it again after " + figure_ms(row.sleep) + " ms";
    case UnitPhase::kRereadCold:
      return "reading it after as much else as it holds";
  }
  return "";
}

}  // namespace

std::optional<Table> condition_table(const Profile& profile) {
  if (profile.conditions.empty()) return std::nullopt;
  Table table{.title = "What else a call may take (medians of execute, ms)",
              .columns = {{"workload", Align::kLeft}, {"unit", Align::kLeft}, {"steady"}}};
  std::vector<Condition> shown;
  for (const Condition condition : kAllConditions) {
    if (std::ranges::find(profile.conditions, condition, &PhaseRow::condition) ==
        profile.conditions.end()) {
      continue;
    }
    shown.push_back(condition);
    std::string name(to_string(condition));
    std::ranges::replace(name, '_', ' ');
    table.columns.push_back({name});
    table.columns.push_back({"of steady"});
  }
  table.columns.push_back({"remarks", Align::kLeft});
  for (const auto& workload : profile.workloads()) {
    for (const auto& unit : profile.units()) {
      const PhaseRow* steady = profile.find(workload, unit, Phase::kExecute);
      std::vector<std::string> row = {workload, unit, median_cell(steady)};
      std::vector<std::string> remarks;
      bool any = false;
      for (const Condition condition : shown) {
        const PhaseRow* found = profile.find_condition(workload, unit, condition);
        any = any || found != nullptr;
        row.push_back(median_cell(found));
        row.push_back(times_cell(found, steady));
        if (found == nullptr || is_valid(*found)) continue;
        remarks.push_back(fmt::format("{}, {}", to_string(condition), judgement_text(*found)));
      }
      row.push_back(join(remarks, "; "));
      if (any) table.rows.push_back(std::move(row));
    }
  }
  table.footnotes = {
      "steady: calls in a row. cold cache, cold memory: the unit's own caches, or the last ones "
      "that it reaches, hold other bytes when a call begins. beside memory, compute: a unit of the "
      "same memory streams, or computes, meanwhile. "
      "- where a call is so long that it makes no difference.",
      std::string(provenance_legend())};
  return table;
}

std::optional<Table> unit_time_table(const Profile& profile) {
  if (profile.unit_times.empty()) return std::nullopt;
  Table table{.title = "What units take beside their calls (us)",
              .columns = {{"unit", Align::kLeft},
                          {"what", Align::kLeft},
                          {"median"},
                          {"p95"},
                          {"p99"},
                          {"samples"},
                          {"remarks", Align::kLeft}}};
  const auto us = [](const UnitTimeRow& row, const std::optional<Nanos>& time) {
    return time ? shown_figure(row, figure(1e6 * to_s(*time)), Provenance::kMeasured) : "invalid";
  };
  for (const UnitTimeRow& row : profile.unit_times) {
    table.rows.push_back({row.unit, what_text(row), us(row, row.median), us(row, row.p95),
                          us(row, row.p99), fmt::format("{}", row.samples), judgement_text(row)});
  }
  table.footnotes = {
      "No part of `call`. Handing over: with the runtime's own queue, until the call begins; "
      "behind "
      "another: from the end of one call to the beginning of the next, which waits. Reading: an "
      "eighth of what the last cache holds, on one core; where it takes longer after a while, "
      "caches forget by themselves."};
  return table;
}

std::vector<Table> condition_tables(const Profile& profile) {
  std::vector<Table> tables;
  for (auto& table : {condition_table(profile), unit_time_table(profile)}) {
    if (table) tables.push_back(*table);
  }
  return tables;
}

Json unit_time_json(const Profile& profile) {
  Json rows = Json::array();
  for (const UnitTimeRow& row : profile.unit_times) {
    Json json = {{"run_id", row.run_id},
                 {"platform", profile.platform()},
                 {"unit", row.unit},
                 {"backend", row.backend},
                 {"phase", to_string(row.phase)},
                 {"sleep_ns", row.sleep.count()},
                 {"provenance", to_string(Provenance::kMeasured)},
                 {"valid", is_valid(row)},
                 {"reasons", row.reasons},
                 {"doubts", row.doubts},
                 {"samples", row.samples}};
    json.put("median_ns", row.median);
    json.put("mad_ns", row.mad);
    json.put("p95_ns", row.p95);
    json.put("p99_ns", row.p99);
    json.put("ci_low_ns", row.ci_low);
    json.put("ci_high_ns", row.ci_high);
    rows.push_back(std::move(json));
  }
  return rows;
}

}  // namespace pirt
