#include "reports/tools/tune_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

std::string title(const std::string& unit, const DeviceInfo& device) {
  return fmt::format("Unit {}: {} ({}){}", unit, device.name, device.version,
                     device.is_cpu ? "; computes on the host's own cores, not a GPU" : "");
}

std::string_view name_of(TuneVerdict verdict) {
  switch (verdict) {
    case TuneVerdict::kReplaced:
      return "replaced";
    case TuneVerdict::kDefaultBest:
      return "default_best";
    case TuneVerdict::kNotConfirmed:
      return "not_confirmed";
    case TuneVerdict::kNotMeasured:
      return "not_measured";
  }
  return "";
}

/// How sure the verdict is, in words.
std::string sureness(const TuneFinding& finding) {
  const std::string measured = fmt::format("{:.2f}x, faster in {} of {} rounds", finding.speed_up,
                                           finding.rounds_faster, finding.rounds);
  switch (finding.verdict) {
    case TuneVerdict::kReplaced:
      return fmt::format("faster in {} of {} rounds (by chance: {:.2g} %)", finding.rounds_faster,
                         finding.rounds, 100 * finding.p_value);
    case TuneVerdict::kDefaultBest:
      return finding.fastest == finding.standard
                 ? "no candidate was faster"
                 : fmt::format("{} is no 2 % faster: {}", finding.fastest, measured);
    case TuneVerdict::kNotConfirmed:
      return finding.rounds == 0 ? "the fastest failed in a later round (below)"
                                 : fmt::format("{} not confirmed: {}", finding.fastest, measured);
    case TuneVerdict::kNotMeasured:
      return "not measured (below)";
  }
  return "";
}

/// All workloads that judged it, or how many if that is too long for a column.
std::string judged_by(const TuneFinding& finding) {
  constexpr std::size_t kNamed = 3;
  std::vector<std::string> names;
  for (const WorkloadGain& gain : finding.gains) names.push_back(gain.workload);
  if (names.empty()) return "-";
  return names.size() <= kNamed ? join(names, " ") : fmt::format("{} workloads", names.size());
}

/// A row for each workload where the default was replaced, since they may gain differently;
/// otherwise one.
void add_rows(const TuneFinding& finding, Table& table) {
  const auto add = [&](const std::string& workload, const std::string& speed_up) {
    table.rows.push_back({workload, std::string(finding.parameter->name),
                          std::to_string(finding.standard), std::to_string(finding.best), speed_up,
                          sureness(finding)});
  };
  if (finding.verdict != TuneVerdict::kReplaced) return add(judged_by(finding), "-");
  for (const WorkloadGain& gain : finding.gains) {
    add(gain.workload, fmt::format("{:.2f}x", gain.speed_up));
  }
  if (finding.gains.size() > 1) add("geometric mean", fmt::format("{:.2f}x", finding.speed_up));
}

}  // namespace

Table tune_table(const TunedUnit& tuned) {
  Table table{.title = title(tuned.unit, tuned.device),
              .columns = {{"workload", Align::kLeft},
                          {"parameter", Align::kLeft},
                          {"default"},
                          {"best"},
                          {"speed-up"},
                          {"how sure", Align::kLeft}}};
  for (const TuneFinding& finding : tuned.outcome.findings) {
    add_rows(finding, table);
    const std::string_view name = finding.parameter->name;
    for (const RejectedCandidate& rejected : finding.rejected) {
      table.footnotes.push_back(
          fmt::format("{}={} {}: {}", name, rejected.value,
                      rejected.wrong ? "computes something else" : "is skipped", rejected.reason));
    }
    if (!finding.reason.empty()) {
      table.footnotes.push_back(
          fmt::format("{}: the default cannot be measured on {}", name, finding.reason));
    }
  }
  if (!tuned.outcome.not_reached.empty()) {
    table.footnotes.push_back(fmt::format("No time for {}; they stay as they are.",
                                          join(tuned.outcome.not_reached, ", ")));
  }
  table.footnotes.insert(table.footnotes.end(), tuned.remarks.begin(), tuned.remarks.end());
  table.footnotes.push_back("In use from now on: " + tuned.outcome.tuning.describe());
  return table;
}

Json tune_json(const TunedUnit& tuned) {
  auto parameters = Json::array();
  for (const TuneFinding& finding : tuned.outcome.findings) {
    Json entry = {{"name", finding.parameter->name}, {"meaning", finding.parameter->meaning},
                  {"default", finding.standard},     {"best", finding.best},
                  {"fastest", finding.fastest},      {"verdict", name_of(finding.verdict)}};
    if (finding.rounds > 0) {
      entry["speed_up"] = finding.speed_up;
      entry["rounds"] = finding.rounds;
      entry["rounds_faster"] = finding.rounds_faster;
      entry["p_value"] = finding.p_value;
    }
    entry["workloads"] = Json::array();
    for (const WorkloadGain& gain : finding.gains) {
      entry["workloads"].push_back({{"name", gain.workload}, {"speed_up", gain.speed_up}});
    }
    entry["rejected"] = Json::array();
    for (const RejectedCandidate& rejected : finding.rejected) {
      entry["rejected"].push_back({{"value", rejected.value},
                                   {"wrong_output", rejected.wrong},
                                   {"reason", rejected.reason}});
    }
    if (!finding.reason.empty()) entry["reason"] = finding.reason;
    parameters.push_back(std::move(entry));
  }
  return {{"unit", tuned.unit},
          {"device", tuned.device.name},
          {"platform", tuned.device.platform},
          {"version", tuned.device.version},
          {"tuning", tuned.outcome.tuning.describe()},
          {"parameters", parameters},
          {"not_reached", tuned.outcome.not_reached},
          {"remarks", tuned.remarks}};
}

Table tune_plan_table(const TuneUnit& unit) {
  Table table{.title = title(unit.unit->name, unit.device),
              .columns = {{"parameter", Align::kLeft},
                          {"default"},
                          {"now"},
                          {"candidates", Align::kLeft},
                          {"workloads", Align::kLeft},
                          {"meaning", Align::kLeft}}};
  for (const TuneStep& step : unit.steps) {
    const auto& range = step.parameter->range(unit.device.is_cpu);
    table.rows.push_back({std::string(step.parameter->name), std::to_string(range.standard),
                          std::to_string(unit.start[step.parameter->parameter]),
                          fmt::format("{}", fmt::join(range.candidates, " ")),
                          join(step.workloads, " "), std::string(step.parameter->meaning)});
  }
  table.footnotes = unit.remarks;
  return table;
}

Json tune_plan_json(const TuneUnit& unit) {
  auto parameters = Json::array();
  for (const TuneStep& step : unit.steps) {
    const auto& range = step.parameter->range(unit.device.is_cpu);
    parameters.push_back(
        {{"name", step.parameter->name},
         {"meaning", step.parameter->meaning},
         {"default", range.standard},
         {"now", unit.start[step.parameter->parameter]},
         {"candidates", std::vector(range.candidates.begin(), range.candidates.end())},
         {"workloads", step.workloads}});
  }
  return {{"unit", unit.unit->name},          {"device", unit.device.name},
          {"platform", unit.device.platform}, {"version", unit.device.version},
          {"tuning", unit.start.describe()},  {"parameters", parameters},
          {"remarks", unit.remarks}};
}

}  // namespace pirt
