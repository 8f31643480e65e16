#include "reports/run/what_if_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

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

/// "1.20 (1.05 to 1.40)": with all calls as long as they may be and as short; "-": not as it is.
std::string holds_text(const WhatIfRow& row) {
  if (!row.holds_if_long && !row.holds_if_short) return figure(row.holds);
  auto low = row.holds_if_long, high = row.holds_if_short;
  if (low && high && *low > *high) std::swap(low, high);  // Of a cap longer calls need more.
  return fmt::format("{} ({} to {})", figure(row.holds), figure(low), figure(high));
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
    table.rows.push_back({row.mode, verdict(row), holds_text(row), figure(row.breaks),
                          or_dash(breakage.pipeline), or_dash(breakage.unit),
                          or_dash(breakage.resource), or_dash(breakage.what)});
    if (!row.not_run.empty()) {
      table.footnotes.push_back(fmt::format("Not run: {}: {}", row.mode, row.not_run));
    }
  }
  for (const WhatIfRow& row : found.rows) {
    for (const std::string& warning : row.warnings) {
      std::string note = "Note: " + warning;
      if (std::ranges::find(table.footnotes, note) != table.footnotes.end()) continue;
      table.footnotes.push_back(std::move(note));
    }
  }
  table.footnotes.emplace_back(
      "holds: the mode keeps up, no deadline missed, no firing dropped but the first that has no "
      "predecessor, nothing queued for more than a period, every task begun, no second above the "
      "cap, in "
      "virtual "
      "time; "
      "in brackets with all calls as long, and as short, as their figures' intervals let them. "
      "Steps of 5 %, then halves of the first that fails; beyond it more may hold "
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
    each.put("holds_if_long", row.holds_if_long);
    each.put("holds_if_short", row.holds_if_short);
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
