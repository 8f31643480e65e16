#include "cli/commands/measure/campaign_text.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <set>
#include <utility>

#include "reports/document/document.h"
#include "workloads/base/text/shell.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

std::string minutes(Nanos value) {
  const auto seconds = value.count() / 1'000'000'000;
  return fmt::format("{}:{:02}", seconds / 60, seconds % 60);
}

/// What the time suffices for, in a sentence or two.
std::string time_text(const CampaignPlan& plan, const CampaignOptions& campaign) {
  const Nanos left = plan.max_time - plan.spent;
  const Nanos precision = plan.precision_time - plan.spent;
  std::string text;
  if (campaign.resumed) {
    text = fmt::format("{} min of {} min are spent. ", minutes(plan.spent), minutes(plan.max_time));
  }
  text +=
      fmt::format("Valid rows, peaks{}{} need {} min", plan.meters.empty() ? "" : ", meters",
                  plan.unit_times.empty() ? "" : ", times of units", minutes(plan.estimate.needed));
  if (plan.estimate.needed > left) {
    return text + fmt::format(
                      ", and nothing begins after {} min (--max-time): some rows will be uncertain "
                      "or missing; from {}.",
                      minutes(left), plan.estimate.source);
  }
  if (precision > plan.estimate.needed) {
    text += fmt::format(", the rest is for precision and ends at {} min", minutes(precision));
  }
  return text + fmt::format("; nothing begins after {} min (--max-time); from {}.", minutes(left),
                            plan.estimate.source);
}

/// "conv1 (cpu, opencl), fc8 (cpu)"
std::string cells_text(const std::vector<CellName>& cells) {
  std::vector<std::pair<std::string, std::vector<std::string>>> by_workload;
  for (const CellName& cell : cells) {
    const auto known = std::ranges::find(by_workload, cell.workload,
                                         [](const auto& entry) { return entry.first; });
    auto& units = known != by_workload.end()
                      ? known->second
                      : by_workload.emplace_back(cell.workload, std::vector<std::string>()).second;
    units.push_back(cell.unit);
  }
  std::vector<std::string> texts;
  for (const auto& [workload, units] : by_workload) {
    texts.push_back(fmt::format("{} ({})", workload, join(units, ", ")));
  }
  return join(texts, ", ");
}

}  // namespace

std::string command_of(const CampaignOptions& campaign) {
  const auto place = [](const std::filesystem::path& path) {
    return path_in_shell(std::filesystem::absolute(path).string());
  };
  const auto name = [&place](const std::string& shipped_or_file) {
    return names_a_file(shipped_or_file) ? place(shipped_or_file) : in_shell(shipped_or_file);
  };
  std::string command = "pirt characterize";
  const auto add = [&command](const char* flag, const std::string& value) {
    command += std::string(" ") + flag + " " + value;
  };
  const auto add_list = [&](const char* flag, const std::vector<std::string>& values) {
    if (!values.empty()) add(flag, in_shell(join(values, ",")));
  };
  if (campaign.quick) command += " --quick";
  if (campaign.interference) command += " --interference";
  add("--platform", name(campaign.platform_argument));
  for (const std::string& setting : campaign.settings) add("--set", in_shell(setting));
  add_list("--units", campaign.units);
  if (!campaign.filter.empty()) add("--filter", in_shell(campaign.filter));
  for (const std::string& file : campaign.own) add("--workloads", place(file));
  add_list("--variants", campaign.variants);
  add_list("--sizes", campaign.sizes);
  if (campaign.batch) add("--batch", std::to_string(*campaign.batch));
  if (campaign.images) add("--images", place(*campaign.images));
  if (!campaign.images_topic.empty()) add("--topics", in_shell("left=" + campaign.images_topic));
  if (!campaign.mix.empty()) add("--mix", name(campaign.mix));
  if (campaign.precision != CampaignOptions{}.precision) {
    add("--precision", fmt::format("{}", campaign.precision));
  }
  if (campaign.max_time) add("--max-time", fmt::format("{}s", to_s(*campaign.max_time)));
  add("--seed", std::to_string(campaign.seed));
  return command;
}

std::string progress_text(const Progress& progress) {
  return fmt::format("[{} of {} done] {} on {}: {}; {} gone, about {} left", progress.done,
                     progress.cells, progress.workload, progress.unit, progress.step,
                     minutes(progress.elapsed), minutes(progress.estimated_left));
}

Json plan_json(const CampaignPlan& plan) {
  auto cells = Json::array();
  for (const auto& cell : plan.cells) {
    cells.push_back(
        {{"workload", cell.workload->name}, {"unit", cell.unit}, {"first", cell.first}});
  }
  auto skipped = Json::array();
  for (const auto& skip : plan.skipped) {
    Json entry = {{"unit", skip.unit}, {"reason", skip.reason}};
    if (!skip.workload.empty()) entry["workload"] = skip.workload;
    skipped.push_back(std::move(entry));
  }
  Json meters = Json::object();
  for (const auto& [unit, meter] : plan.meters) {
    meters[unit] = {{"source", meter.source}, {"domain", meter.domain}};
  }
  return {{"cells", cells},
          {"skipped", skipped},
          {"meters", meters},
          {"remarks", plan.remarks},
          {"estimate_s", to_s(plan.estimate.total)},
          {"needed_s", to_s(plan.estimate.needed)},
          {"max_time_s", to_s(plan.max_time)},
          {"spent_s", to_s(plan.spent)},
          {"estimate_source", plan.estimate.source}};
}

std::string plan_text(const CampaignPlan& plan, const CampaignOptions& campaign) {
  Table table{.title = fmt::format("{} cells{}, about {} min", plan.cells.size(),
                                   campaign.resumed ? " left" : "", minutes(plan.estimate.total)),
              .columns = {{"workload", Align::kLeft}, {"unit", Align::kLeft}}};
  for (const auto& cell : plan.cells) table.rows.push_back({cell.workload->name, cell.unit});
  table.footnotes.push_back(time_text(plan, campaign));
  const auto first = std::ranges::count_if(plan.cells, &PlannedCell::first);
  if (first > 0) {
    table.footnotes.push_back(
        fmt::format("{} of them come first: mix {} needs them (--mix).", first, campaign.mix));
  }
  for (const auto& skip : plan.skipped) {
    table.footnotes.push_back(fmt::format("Not measured: {}{}: {}", skip.unit,
                                          skip.workload.empty() ? "" : ", " + skip.workload,
                                          skip.reason));
  }
  for (const auto& [unit, meter] : plan.meters) {
    table.footnotes.push_back(
        fmt::format("Energy of {}: {} ({})", unit, meter.source, meter.domain));
  }
  for (const auto& remark : plan.remarks) table.footnotes.push_back(remark);
  return render({.parts = {table}}, Format::kText);
}

std::string nothing_text(const Profile& profile) {
  std::map<std::string, std::vector<CellName>> by_reason;
  std::vector<CellName> told;
  for (const PhaseRow& row : profile.phases) {
    const CellName cell{row.workload, row.unit};
    if (is_setup(row.phase) || std::ranges::find(told, cell) != told.end()) continue;
    told.push_back(cell);
    const PhaseRow* const call = profile.find(row.workload, row.unit, Phase::kCall);
    by_reason[join((call != nullptr ? *call : row).reasons, ", ")].push_back(cell);
  }
  std::vector<std::string> texts;
  for (const auto& [reason, cells] : by_reason) texts.push_back(cells_text(cells) + ": " + reason);
  return "nothing was measured: " + join(texts, "; ");
}

std::string out_of_time_text(const CampaignSummary& summary, const CampaignPlan& plan,
                             const std::string& database) {
  if (summary.interrupted || summary.complete()) return "";
  std::vector<std::string> missing;
  if (!summary.unmeasured.empty()) {
    missing.push_back(fmt::format("{} cells have no figure: {}", summary.unmeasured.size(),
                                  cells_text(summary.unmeasured)));
    // Such as what is out of reach.
    for (const UnitRecord& unit : plan.units) {
      const auto remark = plan.facts.find("unit." + unit.unit + ".remark");
      const bool is_missing = std::ranges::find(summary.unmeasured, unit.unit, &CellName::unit) !=
                              summary.unmeasured.end();
      if (is_missing && remark != plan.facts.end()) {
        missing.push_back(unit.unit + ": " + remark->second);
      }
    }
  }
  if (summary.cells_begun > 0) {
    missing.push_back(
        fmt::format("{} cells have fewer processes than they need, or no reading of "
                    "their meter",
                    summary.cells_begun));
  }
  if (!summary.peaks_left_out.empty()) {
    missing.push_back("no peaks of " + join(summary.peaks_left_out, ", "));
  }
  if (summary.unit_times_left_out > 0) {
    missing.push_back(fmt::format("{} of the times of units (handover, leave, reread) are missing",
                                  summary.unit_times_left_out));
  }
  return fmt::format(
      "The time was over (--max-time, {} min): {}. Go on with more in all: pirt characterize "
      "--resume --max-time {}min --db {}",
      minutes(plan.max_time), join(missing, "; "), longer_minutes(plan.max_time, summary.elapsed),
      path_in_shell(database));
}

std::string summary_text(const CampaignSummary& summary, const CampaignPlan& plan,
                         const CampaignOptions& campaign) {
  const std::string begun =
      summary.cells_begun > 0 ? fmt::format(" and {} in part", summary.cells_begun) : "";
  return fmt::format(
      "{} of {} cells{} in {} min from {} processes, {} within {:.3g} %; {} good, {} uncertain and "
      "{} invalid rows, in {}",
      summary.cells, plan.cells.size(), begun, minutes(summary.elapsed), summary.processes,
      summary.within_precision, 100 * campaign.precision, summary.rows_valid, summary.rows_doubted,
      summary.rows_invalid, campaign.database.string());
}

std::string precision_text(const CampaignSummary& summary, const CampaignPlan& plan,
                           const CampaignOptions& campaign) {
  if (campaign.quick || 2 * summary.within_precision >= summary.cells) return "";
  const auto longer = std::chrono::ceil<std::chrono::minutes>(4 * plan.precision_time);
  return fmt::format(
      "Less than half of the cells are within {:.3g} %: `pirt doctor` says what disturbs this "
      "machine; --max-time {}min halves the intervals where nothing helps",
      100 * campaign.precision, longer.count());
}

std::string doubted_text(const Profile& profile, const CampaignOptions& campaign) {
  int rows = 0;
  std::set<std::string> workloads, why;
  for (const PhaseRow& row : profile.phases) {
    if (!is_doubted(row)) continue;
    ++rows;
    workloads.insert(row.workload);
    why.insert(row.doubts.begin(), row.doubts.end());
  }
  if (rows == 0) return "";
  CampaignOptions again = campaign;
  again.filter = "^(" + join(std::vector(workloads.begin(), workloads.end()), "|") + ")$";
  again.variants.clear();  // The filter names them.
  again.sizes.clear();
  again.batch.reset();
  again.mix.clear();
  again.quick = false;  // More precision is wanted.
  again.max_time.reset();
  return fmt::format(
      "{} rows are uncertain ({}), and used as they are: `pirt doctor` says what disturbs this "
      "machine; when it is quiet, or with more time (--max-time): {} --db {}",
      rows, join(std::vector(why.begin(), why.end()), ", "), command_of(again),
      path_in_shell(campaign.database.string()));
}

std::string clock_text(const RunInfo& run) {
  const auto cost = run.environment.find("clock_cost_ns");
  if (cost == run.environment.end()) return "";
  return fmt::format(
      "Clock: {} ns a reading, at most {:.2g} % of a call's sample (1 ms or more) and 0.1 % of a "
      "phase's",
      cost->second, std::stod(cost->second) / 1e6 * 100);
}

Json summary_json(const CampaignSummary& summary) {
  Json unmeasured = Json::array();
  for (const CellName& cell : summary.unmeasured) {
    unmeasured.push_back({{"workload", cell.workload}, {"unit", cell.unit}});
  }
  return {{"run_id", summary.run_id},
          {"cells_unmeasured", unmeasured},
          {"peaks_left_out", summary.peaks_left_out},
          {"unit_times_left_out", summary.unit_times_left_out},
          {"cells", summary.cells},
          {"cells_begun", summary.cells_begun},
          {"processes", summary.processes},
          {"within_precision", summary.within_precision},
          {"rows_valid", summary.rows_valid},
          {"rows_doubted", summary.rows_doubted},
          {"rows_invalid", summary.rows_invalid},
          {"interrupted", summary.interrupted},
          {"elapsed_s", to_s(summary.elapsed)}};
}

}  // namespace pirt::cli
