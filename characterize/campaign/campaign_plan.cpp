// Which cells a campaign has: arguments checked, units probed, workloads chosen. Declared in
// campaign.h.
#include <fmt/core.h>

#include <algorithm>

#include "characterize/campaign/campaign.h"
#include "characterize/campaign/campaign_estimate.h"
#include "characterize/campaign/campaign_meters.h"
#include "characterize/campaign/campaign_resume.h"
#include "characterize/campaign/run_facts.h"
#include "characterize/platform/platform_cores.h"
#include "characterize/platform/selection.h"
#include "characterize/platform/unit_request.h"
#include "characterize/worker/job_runner.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/catalog.h"
#include "workloads/catalog/own_list.h"
#include "workloads/catalog/specs.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/own_operation.h"

namespace pirt {
namespace {

/// Those that were chosen; without a filter also what the mix needs, in its sizes. Beside workloads
/// of others' that is of a mix that takes some of those.
std::vector<const Workload*> wanted_workloads(const CampaignOptions& options) {
  auto all = choose_workloads(options.filter, options.variants, options.batch, options.sizes);
  if (!options.filter.empty()) return all;
  std::vector<const Workload*> needed;
  for (const NeededWorkload& each : options.first) {
    if (const Workload* const known = try_find_workload(each.workload)) needed.push_back(known);
  }
  const auto is_own = [](const Workload* each) { return own_operation(*each) != nullptr; };
  if (!own_workloads().empty() && std::ranges::none_of(needed, is_own)) return all;
  for (const Workload* each : needed) {
    if (std::ranges::find(all, each) == all.end()) all.push_back(each);
  }
  return all;
}

void add_unit(const UnitModel& unit, const JobResult& probed, CampaignPlan& plan) {
  const DeviceInfo& device = probed.device.value();
  plan.units.push_back(unit_record(unit, device));
  plan.provenances.push_back(probed.provenance);
  plan.devices.push_back(device);
  plan.facts.merge(unit_facts(unit, device));
  if (!device.remark.empty()) plan.remarks.push_back(unit.name + ": " + device.remark);
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

bool is_first(const CampaignOptions& options, const PlannedCell& cell) {
  const UnitModel& unit = options.platform.unit(cell.unit);
  return std::ranges::any_of(options.first, [&](const NeededWorkload& needed) {
    const auto serves = [&unit](const std::string& name) {
      return name == unit.name || name == to_string(unit.role);
    };
    return needed.workload == cell.workload->name &&
           (needed.served_by.empty() || std::ranges::any_of(needed.served_by, serves));
  });
}

/// The platform with the units alone that have cells.
Platform chosen(const CampaignOptions& options, const CampaignPlan& plan) {
  Platform platform = options.platform;
  std::erase_if(platform.units, [&plan](const UnitModel& unit) {
    return std::ranges::find(plan.units, unit.name, &UnitRecord::unit) == plan.units.end();
  });
  return platform;
}

/// Those that an unfinished run does not have.
void plan_unit_times(const CampaignOptions& options, CampaignPlan& plan) {
  if (!options.unit_times) return;
  const auto is_known = [&options](const UnitRecord& unit, const UnitTimePart& part) {
    return options.resumed &&
           std::ranges::any_of(options.resumed->unit_times, [&](const UnitTimeRow& row) {
             return row.unit == unit.unit && row.phase == part.phase && row.sleep == part.sleep;
           });
  };
  for (const UnitRecord& unit : plan.units) {
    for (UnitTimePart& part : options.unit_times(unit)) {
      if (is_known(unit, part)) continue;
      plan.unit_times.push_back({unit.unit, cores_or_usable(unit.cores), std::move(part)});
    }
  }
}

/// How long it may take, and how long it will.
void plan_time(const CampaignOptions& options, CampaignPlan& plan) {
  const Nanos beside_cells = time_beside_cells(plan);
  const Nanos of_cells =
      static_cast<std::int64_t>(plan.cells.size()) * (options.quick ? kQuickTime : kFullTime);
  const Nanos usual = plan.spent + of_cells + beside_cells;
  // Whoever has a slow meter asks for quick figures all the same.
  const Nanos most_quick = kMostQuickTime + std::min(metering_time(plan), 2 * kMostQuickTime);
  plan.max_time =
      options.max_time.value_or(options.quick ? most_quick : std::max(kMostQuickTime, usual));
  plan.precision_time = std::min(
      plan.max_time, options.precision_time.value_or(options.max_time ? plan.max_time : usual));
  if (options.resumed && plan.spent >= plan.max_time) {
    throw_bad_input(fmt::format(
        "run {} has spent its time ({:.3g} s of {:.3g} s); give more in all, e.g. --max-time {}min",
        options.resumed->run.run_id, to_s(plan.spent), to_s(plan.max_time),
        longer_minutes(plan.max_time, plan.spent)));
  }
  plan.estimate = estimate(options, plan);
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

std::int64_t longer_minutes(Nanos max_time, Nanos spent) {
  return std::chrono::ceil<std::chrono::minutes>(2 * std::max(max_time, spent)).count();
}

CampaignPlan plan_campaign(const CampaignOptions& options) {
  if (options.max_time && options.max_time->count() <= 0) {
    throw_bad_input("--max-time is not above 0; try 9min");
  }
  if (!(options.precision > 0 && options.precision < 1)) {
    throw_bad_input(fmt::format("--precision {} is not between 0 and 1 (or 0 % and 100 %); try 2%",
                                options.precision));
  }
  const auto workloads = wanted_workloads(options);
  const auto units = choose_units(options.platform, options.units);
  for (const UnitModel* unit : units) {
    // A malformed request is the user's slip, also where its device is only reached in a worker.
    static_cast<void>(
        find_backend(unit->backend)
            .supports_on(make_unit_request(options.platform, *unit), *workloads.front()));
  }
  if (options.images) static_cast<void>(images_from(*options.images, options.images_topic));

  CampaignPlan plan;
  const JobRunner runner(options.program, options.job_limit, options.stop);
  for (const UnitModel* unit : units) {
    const JobResult probed = probe_unit(runner, options.platform, *unit);
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
  const auto of_cores = core_remarks(chosen(options, plan), physical_cores(usable_cores()));
  plan.remarks.insert(plan.remarks.end(), of_cores.begin(), of_cores.end());
  if (!of_cores.empty()) plan.facts["cores_remark"] = join(of_cores, "; ");
  for (PlannedCell& cell : plan.cells) cell.first = is_first(options, cell);
  for (const NeededWorkload& needed : options.first) {
    if (try_find_spec(needed.workload) || options.platform.workloads.contains(needed.workload)) {
      continue;
    }
    plan.remarks.push_back(fmt::format(
        "mix {} needs '{}', and nothing says what that is{}; give its file with --workloads, or "
        "its times (pirt import)",
        options.mix, needed.workload, suggestion(needed.workload, workload_names())));
  }
  plan_meters(options, plan);
  plan_unit_times(options, plan);
  if (options.resumed) plan.spent = options.resumed->spent;
  plan_time(options, plan);
  return plan;
}

}  // namespace pirt
