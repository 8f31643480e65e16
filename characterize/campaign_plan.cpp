// Which cells a campaign has: arguments checked, units probed, workloads chosen. Declared in
// campaign.h.
#include <fmt/format.h>

#include <algorithm>
#include <regex>
#include <set>

#include "characterize/campaign.h"
#include "characterize/campaign_estimate.h"
#include "characterize/campaign_meters.h"
#include "characterize/campaign_resume.h"
#include "characterize/job_runner.h"
#include "characterize/unit_request.h"
#include "workloads/base/error.h"
#include "workloads/base/text.h"
#include "workloads/catalog.h"
#include "workloads/registry.h"

namespace pirt {
namespace {

/// That of the option, and those that the filter names: "fc6@batch8".
std::set<int> wanted_batches(const CampaignOptions& options) {
  std::set<int> batches;
  if (options.batch) batches.insert(*options.batch);
  static const std::regex kNamed("@batch([0-9]{1,3})");
  for (std::sregex_iterator it(options.filter.begin(), options.filter.end(), kNamed), end;
       it != end; ++it) {
    batches.insert(std::stoi((*it)[1]));
  }
  return batches;
}

/// The plain workloads and the variants and batches that are asked for: by name, or in the filter.
std::vector<const Workload*> all_workloads(const CampaignOptions& options) {
  std::vector<const Workload*> all;
  for (const Workload& workload : catalog()) all.push_back(&workload);
  std::vector<std::string> wanted = options.variants;
  if (options.filter.find('@') != std::string::npos) {
    for (const Variant& variant : variants()) wanted.emplace_back(variant.name);
  }
  for (const std::string& name : wanted) {
    for (const Workload* workload : workloads_in_variant(name)) {
      if (std::ranges::find(all, workload) == all.end()) all.push_back(workload);
    }
  }
  for (const int batch : wanted_batches(options)) {
    for (const Workload& workload : workloads_in_batch(batch)) all.push_back(&workload);
  }
  return all;
}

std::vector<const Workload*> choose_workloads(const CampaignOptions& options) {
  const std::string& filter = options.filter;
  std::vector<const Workload*> chosen;
  try {
    const std::regex pattern(filter, std::regex::ECMAScript);
    for (const Workload* workload : all_workloads(options)) {
      if (std::regex_search(workload->name, pattern)) chosen.push_back(workload);
    }
  } catch (const std::regex_error& error) {
    throw_bad_input(
        fmt::format("--filter '{}' is not a regular expression ({}); try a workload's name, or "
                    "'conv[12]|sobel'",
                    filter, error.what()));
  }
  if (chosen.empty()) {
    throw_bad_input(fmt::format("--filter '{}' matches no workload{}; see: pirt list workloads",
                                filter, suggestion(filter, workload_names())));
  }
  return chosen;
}

std::vector<const UnitModel*> choose_units(const CampaignOptions& options) {
  const Platform& platform = options.platform;
  std::vector<const UnitModel*> chosen;
  for (const std::string& name : options.units) {
    const UnitModel& unit = platform.unit(name);
    if (!unit.measured()) {
      throw_bad_input(fmt::format(
          "unit '{}' of platform '{}' has no backend: its times are in the platform file, there is "
          "nothing to measure",
          name, platform.name));
    }
    if (std::ranges::find(chosen, &unit) == chosen.end()) chosen.push_back(&unit);
  }
  if (!options.units.empty()) return chosen;
  for (const UnitModel& unit : platform.units) {
    if (unit.measured()) chosen.push_back(&unit);
  }
  if (chosen.empty()) {
    throw_bad_input(fmt::format(
        "platform '{}' has no unit to measure (no unit names a backend); try --platform host",
        platform.name));
  }
  return chosen;
}

JobResult probe(const CampaignOptions& options, const UnitModel& unit, const JobRunner& runner) {
  Job job;
  job.kind = JobKind::kProbe;
  job.backend = unit.backend;
  job.unit = make_unit_request(options.platform, unit);
  const auto result = runner.run(job);
  if (!result) throw_environment("interrupted while probing the units; nothing was stored");
  return *result;
}

void add_unit(const UnitModel& unit, const JobResult& probed, CampaignPlan& plan) {
  const DeviceInfo& device = probed.device.value();
  plan.units.push_back({unit.name, unit.backend, device.name.empty() ? "unnamed" : device.name,
                        device.is_cpu, unit.cores});
  plan.provenances.push_back(probed.provenance);
  const std::string prefix = "unit." + unit.name + ".";
  if (!device.platform.empty()) plan.facts[prefix + "platform"] = device.platform;
  if (!device.version.empty()) plan.facts[prefix + "version"] = device.version;
  if (device.cache_bytes) plan.facts[prefix + "cache_bytes"] = std::to_string(*device.cache_bytes);
}

/// Adds the cells of one unit that is there, or why it has none.
void add_cells(const CampaignOptions& options, const UnitModel& unit, const JobResult& probed,
               const std::vector<const Workload*>& workloads, CampaignPlan& plan) {
  const Backend& backend = find_backend(unit.backend);
  const UnitRequest request = make_unit_request(options.platform, unit);
  bool any = false;
  for (const Workload* workload : workloads) {
    const Support support = backend.supports_on(request, *workload);
    if (support.ok) {
      plan.cells.push_back({workload, unit.name});
      any = true;
    } else {
      plan.skipped.push_back({unit.name, workload->name, support.reason});
    }
  }
  if (any) add_unit(unit, probed, plan);
}

[[noreturn]] void throw_nothing_to_measure(const std::vector<Skip>& skipped) {
  std::vector<std::string> reasons;
  for (const Skip& skip : skipped) {
    const std::string of = skip.workload.empty() ? skip.unit : skip.workload + " on " + skip.unit;
    reasons.push_back(of + ": " + skip.reason);
  }
  throw_environment("nothing can be measured: " + join(reasons, "; "));
}

}  // namespace

CampaignPlan plan_campaign(const CampaignOptions& options) {
  if (options.max_time && options.max_time->count() <= 0) {
    throw_bad_input("--max-time is not above 0; try 9min");
  }
  if (!(options.precision > 0 && options.precision < 1)) {
    throw_bad_input(fmt::format("--precision {} is not between 0 and 1 (or 0 % and 100 %); try 2%",
                                options.precision));
  }
  const auto workloads = choose_workloads(options);
  const auto units = choose_units(options);
  for (const UnitModel* unit : units) {
    // A malformed request is the user's slip, also where its device is only reached in a worker.
    static_cast<void>(
        find_backend(unit->backend)
            .supports_on(make_unit_request(options.platform, *unit), *workloads.front()));
  }
  if (options.images) static_cast<void>(images_from(*options.images));

  CampaignPlan plan;
  const JobRunner runner(options.program, options.job_limit, options.stop);
  for (const UnitModel* unit : units) {
    const JobResult probed = probe(options, *unit, runner);
    if (probed.error.empty()) {
      add_cells(options, *unit, probed, workloads, plan);
    } else if (!options.units.empty()) {
      throw_environment(fmt::format("unit '{}' is not available: {}", unit->name, probed.error));
    } else {
      plan.skipped.push_back({unit->name, "", probed.error});
    }
  }
  if (plan.cells.empty()) throw_nothing_to_measure(plan.skipped);
  if (options.resumed) restrict_to_stored(*options.resumed, plan);
  plan_meters(options, plan);
  const Nanos metering = metering_time(plan);
  plan.max_time = options.max_time.value_or(static_cast<std::int64_t>(plan.cells.size()) *
                                                (options.quick ? kQuickTime : kFullTime) +
                                            metering);
  plan.estimate = estimate(options, plan);
  plan.estimate.needed += metering;
  plan.estimate.total += metering;
  return plan;
}

}  // namespace pirt
