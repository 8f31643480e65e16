#include "reports/run/what_if_report.h"

#include <fmt/core.h>

#include "reports/document/figures.h"

namespace pirt {
namespace {

std::string or_dash(const std::string& text) { return text.empty() ? "-" : text; }

/// What a reader wants to know of the row in a word.
std::string verdict(const WhatIfRow& row) {
  if (!row.not_run.empty()) return "not run";
  if (!row.holds) return "does not fit as it is";
  return row.breaks ? "gives" : "holds as far as was tried";
}

}  // namespace

Document what_if_document(const WhatIf& found, const Platform& platform, const Mix& mix) {
  const std::string unit = found.unit.empty() ? "" : " " + found.unit;
  Document document{.title = "pirt what-if", .parts = {}};
  document.parts.emplace_back(Paragraph{
      {fmt::format("Mix {} on platform {}: {} from {}{} to {}{}", mix.name, platform.name,
                   found.parameter, figure(found.given), unit, figure(found.last_tried), unit)}});
  Table table{.title = "What breaks first",
              .columns = {{"mode", Align::kLeft},
                          {"", Align::kLeft},
                          {"holds at" + unit},
                          {"breaks at" + unit},
                          {"pipeline", Align::kLeft},
                          {"unit", Align::kLeft},
                          {"too little of", Align::kLeft},
                          {"seen", Align::kLeft}}};
  for (const WhatIfRow& row : found.rows) {
    const Breakage none;
    const Breakage& breakage = row.breakage ? *row.breakage : none;
    table.rows.push_back({row.mode, verdict(row), figure(row.holds), figure(row.breaks),
                          or_dash(breakage.pipeline), or_dash(breakage.unit),
                          or_dash(breakage.resource), or_dash(breakage.what)});
    if (!row.not_run.empty()) {
      table.footnotes.push_back(fmt::format("Not run: {}: {}", row.mode, row.not_run));
    }
  }
  table.footnotes.emplace_back(
      "holds: no deadline missed, no firing dropped, all rates kept, no second above the cap, in "
      "virtual time. Steps of 5 %, then halves of the first that fails; beyond it more may hold "
      "again.");
  document.parts.emplace_back(std::move(table));
  return document;
}

Json what_if_json(const WhatIf& found, const Platform& platform, const Mix& mix) {
  Json rows = Json::array();
  for (const WhatIfRow& row : found.rows) {
    Json each = {{"mode", row.mode}};
    if (!row.not_run.empty()) each["not_run"] = row.not_run;
    if (row.holds) each["holds"] = *row.holds;
    if (row.breaks) each["breaks"] = *row.breaks;
    if (row.breakage) {
      each["breakage"] = {{"pipeline", row.breakage->pipeline},
                          {"unit", row.breakage->unit},
                          {"resource", row.breakage->resource},
                          {"what", row.breakage->what}};
    }
    rows.push_back(std::move(each));
  }
  return {{"schema_version", 1},
          {"platform", platform.name},
          {"mix", mix.name},
          {"parameter", found.parameter},
          {"unit", found.unit},
          {"given", found.given},
          {"last_tried", found.last_tried},
          {"modes", rows}};
}

}  // namespace pirt
