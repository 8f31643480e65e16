#include "characterize/campaign/campaign_resume.h"

#include <fmt/core.h>

#include <algorithm>
#include <set>

#include "characterize/profile/identity.h"
#include "characterize/profile/own_rows.h"
#include "characterize/profile/store/reader.h"
#include "characterize/worker/job.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr int kPlanVersion = 1;

[[noreturn]] void throw_unreadable(const UnfinishedRun& run, const std::string& why) {
  throw_bad_input(
      fmt::format("run {} cannot be gone on with ({}); start a new run", run.run.run_id, why));
}

/// Calls @p read, whose errors are those of a plan that this pirt did not write.
template <typename Read>
auto reading(const UnfinishedRun& run, Read read) {
  try {
    return read();
  } catch (const JsonError& error) {
    throw_unreadable(run, error.what());
  }
}

Json parse_plan(const UnfinishedRun& run) {
  std::optional<Json> json = try_parse_json(run.plan);
  if (!json || !json->is_object()) throw_unreadable(run, "its plan is no JSON object");
  const int version = reading(run, [&json] { return json->value("version", 0); });
  if (version != kPlanVersion) {
    throw_unreadable(
        run, fmt::format("its plan has version {}, and this pirt knows {}", version, kPlanVersion));
  }
  return *std::move(json);
}

void check_visits(const UnfinishedRun& run) {
  for (const auto& [cell, visit] : run.visits) {
    try {
      static_cast<void>(last_record(visit.record));
    } catch (const Error& error) {
      throw_unreadable(run, fmt::format("process {} of {} on {}: {}", visit.position, cell.workload,
                                        cell.unit, error.what()));
    }
  }
}

Json first_json(const CampaignOptions& options) {
  Json first = Json::array();
  for (const NeededWorkload& each : options.first) {
    first.push_back({{"workload", each.workload}, {"served_by", each.served_by}});
  }
  return first;
}

std::vector<NeededWorkload> first_of(const Json& json) {
  std::vector<NeededWorkload> first;
  for (const Json& each : json) {
    first.push_back({each.at("workload").get<std::string>(),
                     each.at("served_by").get<std::vector<std::string>>()});
  }
  return first;
}

std::string reason_of(const CampaignPlan& plan, const CellName& cell) {
  for (const Skip& skip : plan.skipped) {
    if (skip.unit == cell.unit && (skip.workload.empty() || skip.workload == cell.workload)) {
      return skip.reason;
    }
  }
  return "the platform or the catalog changed";
}

}  // namespace

std::string stored_plan(const CampaignOptions& options, const CampaignPlan& plan) {
  Json cells = Json::array();
  for (const PlannedCell& cell : plan.cells) cells.push_back({cell.workload->name, cell.unit});
  Json json = {{"version", kPlanVersion},
               {"platform", options.platform_argument},
               {"settings", options.settings},
               {"units", options.units},
               {"own", options.own},
               {"sizes", options.sizes},
               {"filter", options.filter},
               {"variants", options.variants},
               {"seed", std::to_string(options.seed)},
               {"precision", options.precision},
               {"quick", options.quick},
               {"interference", options.interference},
               {"max_time_ns", plan.max_time.count()},
               {"precision_time_ns", plan.precision_time.count()},
               {"mix", options.mix},
               {"first", first_json(options)},
               {"cells", cells}};
  if (options.batch) json["batch"] = *options.batch;
  if (options.images) json["images"] = std::filesystem::absolute(*options.images).string();
  if (!options.images_topic.empty()) json["images_topic"] = options.images_topic;
  return json_text(json);
}

CampaignOptions resume_options(const std::filesystem::path& database) {
  auto run = find_unfinished_run(database);
  if (!run) {
    throw_bad_input(fmt::format(
        "'{}' has no unfinished run that could be gone on with; start one without --resume",
        database.string()));
  }
  const Json json = parse_plan(*run);
  check_visits(*run);
  return reading(*run, [&] {
    CampaignOptions options;
    options.database = database;
    options.platform_argument = json.at("platform").get<std::string>();
    options.settings = json.at("settings").get<std::vector<std::string>>();
    options.platform = load_platform(options.platform_argument, parse_overrides(options.settings));
    options.units = json.at("units").get<std::vector<std::string>>();
    options.filter = json.at("filter").get<std::string>();
    options.own = json.value("own", Json::array()).get<std::vector<std::string>>();
    options.sizes = json.value("sizes", Json::array()).get<std::vector<std::string>>();
    options.variants = json.value("variants", std::vector<std::string>{});
    if (json.contains("batch")) options.batch = json.at("batch").get<int>();
    options.seed = run->run.seed;
    options.precision = json.at("precision").get<double>();
    options.quick = json.at("quick").get<bool>();
    options.interference = json.value("interference", false);  // Plans of before have none.
    options.max_time = Nanos(json.at("max_time_ns").get<std::int64_t>());
    options.precision_time = Nanos(json.value("precision_time_ns", options.max_time->count()));
    options.mix = json.value("mix", std::string());
    if (json.contains("first")) options.first = first_of(json.at("first"));
    if (json.contains("images")) options.images = json.at("images").get<std::string>();
    options.images_topic = json.value("images_topic", std::string());
    options.resumed = std::move(run);
    return options;
  });
}

void restrict_to_stored(const UnfinishedRun& run, CampaignPlan& plan) {
  const Json json = parse_plan(run);
  std::vector<PlannedCell> left;
  reading(run, [&] {
    for (const Json& entry : json.at("cells")) {
      const CellName name{entry.at(0).get<std::string>(), entry.at(1).get<std::string>()};
      if (std::ranges::find(run.done, name) != run.done.end()) continue;
      const auto planned = std::ranges::find_if(plan.cells, [&](const PlannedCell& cell) {
        return cell.workload->name == name.workload && cell.unit == name.unit;
      });
      if (planned == plan.cells.end()) {
        throw_environment(
            fmt::format("run {} cannot be gone on with: {} on {} cannot be measured "
                        "any more: {}",
                        run.run.run_id, name.workload, name.unit, reason_of(plan, name)));
      }
      left.push_back(*planned);
    }
  });
  plan.cells = std::move(left);
}

void check_identity(const RunInfo& run, const Environment& facts) {
  RunInfo now = run;
  now.environment = facts;
  const auto text = [](const std::optional<std::string>& value) {
    return value ? "'" + *value + "'" : std::string("nothing");
  };
  std::vector<std::string> changed;
  for (const auto& each : compare_identity(run, now)) {
    changed.push_back(fmt::format("{} was {} and is {}", each.field, text(each.a), text(each.b)));
  }
  for (const auto& each : compare_program(run, now)) {
    changed.push_back(
        fmt::format("{} ({} was {} and is {})", each.why, each.field, text(each.a), text(each.b)));
  }
  for (auto fact = run.environment.lower_bound(std::string(kOwnFact));
       fact != run.environment.end() && fact->first.starts_with(kOwnFact); ++fact) {
    const auto other = facts.find(fact->first);
    if (other == facts.end() || other->second == fact->second) continue;
    changed.push_back(fact->first.substr(kOwnFact.size()) + " was built anew");
  }
  if (changed.empty()) return;
  throw_bad_input(fmt::format(
      "run {} cannot be gone on with, its figures would not be comparable: {}; start a new run",
      run.run_id, join(changed, ", ")));
}

}  // namespace pirt
