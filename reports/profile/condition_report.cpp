#include "reports/profile/condition_report.h"

#include <fmt/core.h>

#include <algorithm>

#include "reports/document/figures.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

std::string cell(const PhaseRow* row) {
  if (row == nullptr) return "-";
  return row->valid ? marked(figure_ms(row->median), row->provenance) : "invalid";
}

/// Of steady; "-" where one of them is not known.
std::string times(const PhaseRow* row, const PhaseRow* steady) {
  const bool known = row != nullptr && steady != nullptr && row->valid && steady->valid &&
                     row->median && steady->median && steady->median->count() > 0;
  if (!known) return "-";
  return fmt::format("{:.2f}x", to_s(*row->median) / to_s(*steady->median));
}

std::string sleep_text(Nanos sleep) {
  return sleep == Nanos(0) ? "none, it is called" : figure_ms(sleep) + " ms";
}

template <typename T>
void put(Json& object, const char* key, const std::optional<T>& value) {
  if (value) object[key] = value->count();
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
      std::vector<std::string> row = {workload, unit, cell(steady)};
      std::vector<std::string> remarks;
      bool any = false;
      for (const Condition condition : shown) {
        const PhaseRow* found = profile.find_condition(workload, unit, condition);
        any = any || found != nullptr;
        row.push_back(cell(found));
        row.push_back(times(found, steady));
        if (found == nullptr || found->valid) continue;
        remarks.push_back(
            fmt::format("INVALID {}: {}", to_string(condition), join(found->reasons, ", ")));
      }
      row.push_back(join(remarks, "; "));
      if (any) table.rows.push_back(std::move(row));
    }
  }
  table.footnotes = {
      "steady: calls in a row. cold cache: the unit's own caches hold other bytes when a call "
      "begins. beside memory, compute: a unit of the same memory streams, or computes, meanwhile. "
      "- where a call is so long that it makes no difference.",
      std::string(provenance_legend())};
  return table;
}

std::optional<Table> handover_table(const Profile& profile) {
  if (profile.handovers.empty()) return std::nullopt;
  Table table{.title = "Until a call begins that is handed to a unit (us)",
              .columns = {{"unit", Align::kLeft},
                          {"it slept", Align::kLeft},
                          {"median"},
                          {"p95"},
                          {"p99"},
                          {"samples"},
                          {"remarks", Align::kLeft}}};
  const auto us = [](const HandoverRow& row, const std::optional<Nanos>& time) {
    return row.valid && time ? figure(1e6 * to_s(*time)) : std::string("invalid");
  };
  for (const HandoverRow& row : profile.handovers) {
    table.rows.push_back({row.unit, sleep_text(row.sleep), us(row, row.median), us(row, row.p95),
                          us(row, row.p99), fmt::format("{}", row.samples),
                          row.valid ? "" : "INVALID: " + join(row.reasons, ", ")});
  }
  table.footnotes = {
      "With the runtime's own queue; no part of `call`. Not asleep: from the end of one call to "
      "the "
      "beginning of the next, which waits."};
  return table;
}

std::vector<Table> condition_tables(const Profile& profile) {
  std::vector<Table> tables;
  for (auto& table : {condition_table(profile), handover_table(profile)}) {
    if (table) tables.push_back(*table);
  }
  return tables;
}

Json handover_json(const Profile& profile) {
  Json rows = Json::array();
  for (const HandoverRow& row : profile.handovers) {
    Json json = {{"run_id", row.run_id},
                 {"unit", row.unit},
                 {"phase", "handover"},
                 {"sleep_ns", row.sleep.count()},
                 {"provenance", to_string(Provenance::kMeasured)},
                 {"valid", row.valid},
                 {"reasons", row.reasons},
                 {"samples", row.samples}};
    put(json, "median_ns", row.median);
    put(json, "mad_ns", row.mad);
    put(json, "p95_ns", row.p95);
    put(json, "p99_ns", row.p99);
    put(json, "ci_low_ns", row.ci_low);
    put(json, "ci_high_ns", row.ci_high);
    rows.push_back(std::move(json));
  }
  return rows;
}

}  // namespace pirt
