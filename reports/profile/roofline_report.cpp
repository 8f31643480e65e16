#include "reports/profile/roofline_report.h"

#include <fmt/core.h>

#include <set>

#include "reports/document/figures.h"
#include "reports/profile/shown_row.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

bool is_bandwidth(PeakKind kind) {
  return kind == PeakKind::kBandwidthL2 || kind == PeakKind::kBandwidthMemory;
}

/// A word for table cells.
std::string short_name(PeakKind kind) {
  switch (kind) {
    case PeakKind::kBandwidthL2:
      return "L2";
    case PeakKind::kBandwidthMemory:
      return "memory";
    default:
      return std::string(to_string(kind));
  }
}

std::string rate(const PeakRow& peak) {
  if (!peak.per_second) return "-";
  return marked(figure(*peak.per_second / 1e9), peak.provenance) +
         (is_bandwidth(peak.kind) ? " GB/s" : " Gop/s");
}

Json cell_json(const Roofline& cell) {
  Json json = {{"workload", cell.workload}, {"unit", cell.unit}};
  if (!cell.fraction) {
    json["why_not"] = cell.why_not;
    return json;
  }
  json["fraction"] = *cell.fraction;
  json["bound"] = to_string(cell.bound);
  json["counts"] = cell.intensity ? "operations" : "bytes";
  json["roof_per_second"] = cell.roof_per_second;
  json["reached_per_second"] = cell.reached_per_second;
  json["provenance"] = to_string(cell.provenance);
  if (cell.intensity) json["intensity_ops_per_byte"] = *cell.intensity;
  if (!cell.missing.empty()) json["missing_limit"] = cell.missing;
  return json;
}

}  // namespace

Table peak_table(const Rooflines& rooflines) {
  Table table{.title = "Limits of the units",
              .columns = {{"unit", Align::kLeft},
                          {"limit", Align::kLeft},
                          {"measured"},
                          {"fastest loop", Align::kLeft},
                          {"remarks", Align::kLeft}}};
  for (const PeakRow& peak : rooflines.peaks) {
    table.rows.push_back({peak.unit, std::string(to_string(peak.kind)), rate(peak),
                          peak.variant.empty() ? "-" : peak.variant,
                          peak.per_second ? judgement_text(peak) : join(peak.reasons, "; ")});
  }
  table.footnotes = {
      "f32, int8: operations a second, 2 a multiply-add; bandwidth: bytes a second, reading data "
      "of half "
      "a core's L2, or of several times the largest cache. The fastest sample of the fastest "
      "loop."};
  return table;
}

std::string roofline_cell(const Roofline* roofline) {
  if (roofline == nullptr || !roofline->fraction) return "-";
  const double percent = 100 * *roofline->fraction;
  const auto text =
      percent < 10 ? fmt::format("{:.1f}%", percent) : fmt::format("{:.0f}%", percent);
  return marked(text, roofline->provenance) + " " + short_name(roofline->bound);
}

std::vector<std::string> roofline_footnotes(const Rooflines& rooflines) {
  std::vector<std::string> lines = {
      "roofline: of min(peak, intensity x bandwidth), by operations and compulsory bytes (inputs, "
      "parameters "
      "and outputs, once each) over the median of execute, with the limit that makes the roof. "
      "Bytes that "
      "fit the unit's largest cache count at L2 bandwidth, those beyond it at memory bandwidth; "
      "8-bit "
      "workloads at the int8 peak; where operations depend on the data, bandwidth alone."};
  std::set<std::string> missing;
  for (const Roofline& cell : rooflines.cells) {
    if (!cell.fraction)
      missing.insert(fmt::format("No roofline for {}: {}.", cell.unit, cell.why_not));
    if (cell.fraction && !cell.missing.empty()) {
      missing.insert(fmt::format("Rooflines of {} are without a limit, and may be lower: {}.",
                                 cell.unit, cell.missing));
    }
  }
  lines.insert(lines.end(), missing.begin(), missing.end());
  return lines;
}

Json peak_json(const PeakRow& peak) {
  Json json = {{"run_id", peak.run_id},
               {"unit", peak.unit},
               {"kind", to_string(peak.kind)},
               {"variant", peak.variant},
               {"provenance", to_string(peak.provenance)},
               {"valid", is_valid(peak)},
               {"doubts", peak.doubts},
               {"reasons", peak.reasons}};
  if (peak.per_second) json["per_second"] = *peak.per_second;
  return json;
}

Json roofline_json(const Rooflines& rooflines) {
  auto peaks = Json::array();
  for (const PeakRow& peak : rooflines.peaks) peaks.push_back(peak_json(peak));
  auto cells = Json::array();
  for (const Roofline& cell : rooflines.cells) cells.push_back(cell_json(cell));
  return {{"peaks", peaks}, {"cells", cells}};
}

}  // namespace pirt
