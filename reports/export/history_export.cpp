// The JSON of benchmark-history actions. Declared in profile_export.h.
//
// Source of the keys: benchmark-action/github-action-benchmark, "customSmallerIsBetter".
#include <fmt/core.h>

#include <optional>

#include "reports/export/profile_export.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using Json = Json;

Json entry(const std::string& name, const char* unit, double value,
           std::optional<double> half_width, const std::string& extra) {
  Json json = {{"name", name}, {"unit", unit}, {"value", value}};
  if (half_width) json["range"] = fmt::format("\u00b1 {:.4g}", *half_width);
  json["extra"] = extra;
  return json;
}

}  // namespace

HistoryExport export_history(const Profile& profile) {
  HistoryExport result{.json = Json::array(), .left_out = {}};
  for (const PhaseRow& row : profile.phases) {
    const std::string name = benchmark_name(row);
    if (!is_valid(row) || !row.median) {
      result.left_out.push_back(name + ": " + join(held_against(row), ", "));
      continue;
    }
    std::optional<double> half;
    if (row.ci_low && row.ci_high) {
      half = static_cast<double>((*row.ci_high - *row.ci_low).count()) / 2;
    }
    result.json.push_back(entry(
        name, "ns", static_cast<double>(row.median->count()), half,
        std::string(to_string(row.provenance)) + (row.provenance.mixture ? "; mixture" : "")));
  }
  for (const EnergyRow& row : profile.energies) {
    const std::string name = fmt::format("{}/{}/energy", row.workload, row.unit);
    if (!is_valid(row) || !row.energy_j) {
      result.left_out.push_back(name + ": " + join(held_against(row), ", "));
      continue;
    }
    result.json.push_back(entry(name, "J", *row.energy_j, std::nullopt,
                                fmt::format("{}; {}", to_string(row.provenance), row.source)));
  }
  return result;
}

}  // namespace pirt
