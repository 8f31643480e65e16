#include "scheduler/services/eligibility.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <set>
#include <string_view>
#include <utility>

#include "scheduler/services/scenario.h"
#include "workloads/base/error.h"
#include "workloads/base/text/shell.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/specs.h"

namespace pirt {
namespace {

std::vector<std::string> unit_reasons(const Platform& platform,
                                      const std::vector<ServiceEntry>& entries) {
  std::vector<std::string> reasons;
  for (UnitId unit = 0; unit < entries.size(); ++unit) {
    const bool serves = entries[unit].service.has_value();
    reasons.push_back(
        platform.units[unit].name + ": " +
        (serves ? "not for tasks that the cloud is too slow for" : entries[unit].reason));
  }
  return reasons;
}

/// What to do about workloads that no unit serves.
std::string remedy(const Platform& platform, const Profile* profile,
                   const std::vector<std::string>& missing) {
  const bool measures = std::ranges::any_of(platform.units, &UnitModel::measured);
  const std::string model =
      "give their times under `workloads:` in the platform file, or import them (pirt import)";
  for (const std::string& name : missing) {
    if (!is_foreign(name) || try_find_spec(name)) continue;
    std::vector<std::string> known = workload_names();
    if (profile != nullptr) known = profile->workloads();
    for (const auto& [modelled, model_of_it] : platform.workloads) known.push_back(modelled);
    return "nothing says what '" + name + "' is" + suggestion(name, known) + "; " +
           (measures ? "measure it with --workloads FILE, the module or workload file that has it"
                     : model);
  }
  if (!measures) return model;
  const std::string database = profile == nullptr ? "profile.db" : profile->path;
  return "measure with: " + measure_command(platform, "", missing, database) +
         (profile == nullptr ? ", then give --profile " + database : "");
}

/// The units of that name or role; throws if it is none.
/// @param where  For the message.
UnitMask units_called(const Platform& platform, const std::string& name, const std::string& where) {
  const UnitMask units = units_where(platform.units, [&name](const UnitModel& unit) {
    return unit.name == name || to_string(unit.role) == name;
  });
  if (units != 0 || role_from_string(name)) return units;
  auto candidates = platform.unit_names();
  for (auto& role : role_names()) candidates.push_back(std::move(role));
  throw_bad_input(fmt::format("{}: '{}' is neither a unit of platform {} nor a role{}", where, name,
                              platform.name, suggestion(name, candidates)));
}

/// The units that a list of names stands for; an empty one for all.
UnitMask named_units(const Platform& platform, const std::vector<std::string>& names,
                     const std::string& where) {
  UnitMask mask = names.empty() ? ~UnitMask{0} : 0;
  for (const auto& name : names) mask |= units_called(platform, name, where + ": eligible");
  return mask;
}

}  // namespace

std::string unit_list(const Platform& platform, UnitMask mask) {
  std::vector<std::string> names;
  for (UnitId unit = 0; unit < platform.units.size(); ++unit) {
    if (contains(mask, unit)) names.push_back(platform.units[unit].name);
  }
  return join(names, ", ");
}

std::string task_name(const Mix& mix, const Pipeline& pipeline, const MixTask& task) {
  return "mix " + mix.name + ": pipelines." + pipeline.name + ": " + task.name;
}

std::string measure_command(const Platform& platform, const std::string& unit,
                            const std::vector<std::string>& workloads,
                            const std::string& database) {
  std::string command =
      "pirt characterize --platform " +
      path_in_shell(platform.argument.empty() ? platform.name : platform.argument);
  if (!unit.empty()) command += " --units " + unit;
  for (const std::string& file : files_of(workloads)) {
    command += " --workloads " + path_in_shell(file);
  }
  return command + " --filter '^(" + join(workloads, "|") + ")$' --db " + path_in_shell(database);
}

std::vector<std::string> workloads_of(const Mix& mix) {
  std::vector<std::string> names;
  std::set<std::string_view> seen;
  for (const auto& pipeline : mix.pipelines) {
    for (const auto& task : pipeline.tasks) {
      if (seen.insert(task.workload).second) names.push_back(task.workload);
    }
  }
  return names;
}

UnitMask cloud_units(const Platform& platform) {
  return units_where(platform.units,
                     [](const UnitModel& unit) { return unit.role == Role::kCloud; });
}

namespace {

/// The times that the mix itself gives to tasks, by unit. A unit's own name goes before its role.
GivenServices given_services(const Platform& platform, const Mix& mix) {
  GivenServices given;
  for (const auto& pipeline : mix.pipelines) {
    for (const auto& task : pipeline.tasks) {
      if (task.service.empty()) continue;
      auto& times = given[task.workload];
      for (const auto& [name, time] : task.service) {
        const UnitMask units = units_called(platform, name, task.service_location);
        for (UnitId unit = 0; unit < platform.units.size(); ++unit) {
          if (!contains(units, unit)) continue;
          if (platform.units[unit].name == name) times.erase(unit);
          times.emplace(unit, time);
        }
      }
      if (times.empty()) {
        throw_bad_input(task.service_location + ": none of these units is on platform " +
                        platform.name + " (it has " + join(platform.unit_names(), ", ") +
                        "); give the time on one of them");
      }
    }
  }
  return given;
}

/// [pipeline][task], all that `eligible` names, by unit or by role.
std::vector<std::vector<TaskClass>> named_classes(const Platform& platform, const Mix& mix,
                                                  const ServiceTable& services) {
  std::map<std::string_view, WorkloadId> ids;
  for (const auto& name : services.workloads)
    ids.emplace(name, static_cast<WorkloadId>(ids.size()));
  std::vector<std::vector<TaskClass>> classes;
  for (const auto& pipeline : mix.pipelines) {
    auto& row = classes.emplace_back();
    for (const auto& task : pipeline.tasks) {
      row.push_back(
          {.workload = ids.at(task.workload),
           .eligible = named_units(platform, task.eligible, task_name(mix, pipeline, task)),
           .real_time = pipeline.real_time,
           .image_input = task.image_input});
    }
  }
  return classes;
}

/// Throws where no unit has a service for some workload that the mode could use.
void check_every_workload_served(const Scenario& scenario, const Profile* profile,
                                 CloudUse cloud_use) {
  const Platform& platform = scenario.platform;
  const ServiceTable& services = scenario.services;
  const UnitMask cloud = cloud_units(platform);
  // By workload: some task of it has to be served on the robot.
  std::vector<bool> needed(services.workloads.size(), false);
  for (const auto& row : scenario.classes) {
    for (const TaskClass& kind : row) {
      const bool stays = cloud_use == CloudUse::kNotRealTime && kind.real_time;
      if (stays || cloud_use == CloudUse::kNone) needed[kind.workload] = true;
    }
  }
  std::vector<std::string> missing;
  std::string reasons;
  for (WorkloadId workload = 0; workload < services.workloads.size(); ++workload) {
    const UnitMask served = services.units_of(workload);
    if ((served & ~cloud) != 0 || (served != 0 && !needed[workload])) continue;
    if (missing.empty()) reasons = join(unit_reasons(platform, services.entries[workload]), "; ");
    missing.push_back(services.workloads[workload]);
  }
  if (missing.empty()) return;
  throw_bad_input("mix " + scenario.mix.name + ": no unit of platform " + platform.name +
                  " can serve " + join(missing, ", ") + " (" + missing.front() + " - " + reasons +
                  "); " + remedy(platform, profile, missing));
}

/// What of @p among is uncertain so far that it tells nothing of the order of units, where another
/// one of the robot's own is not.
UnitMask too_uncertain(const Platform& platform, const ServiceTable& services, WorkloadId workload,
                       UnitMask among, std::optional<Role> only) {
  const UnitMask own = among & units_where(platform.units, [only](const UnitModel& unit) {
                         return unit.role != Role::kCloud && (!only || unit.role == *only);
                       });
  const UnitMask wild =
      own & units_where(services.entries[workload], [](const ServiceEntry& entry) {
        return entry.service && entry.service->wild;
      });
  return wild == own ? 0 : wild;
}

/// Of units with `memory_mb`: takes from the services what does not fit there beside what comes
/// before it, in the order of the mix's tasks, if tasks may go there at all. A unit with contexts
/// holds one at a time. What nobody has measured is not counted, and warned of.
void admit_by_memory(Scenario& scenario) {
  const Platform& platform = scenario.platform;
  ServiceTable& services = scenario.services;
  std::vector<UnitMask> wanted(services.workloads.size(), 0);
  for (const auto& row : scenario.classes) {
    for (const TaskClass& kind : row) wanted[kind.workload] |= kind.eligible;
  }
  for (UnitId unit = 0; unit < platform.units.size(); ++unit) {
    const UnitModel& model = platform.units[unit];
    if (!model.memory_limit_bytes) continue;
    const auto megabytes = [](std::int64_t bytes) {
      return fmt::format("{:.4g}", static_cast<double>(bytes) / 1e6);
    };
    std::int64_t held = 0;
    std::vector<std::string> holds, unknown;
    for (WorkloadId workload = 0; workload < services.entries.size(); ++workload) {
      ServiceEntry& entry = services.entries[workload][unit];
      const std::string& name = services.workloads[workload];
      if (!entry.service || !contains(wanted[workload], unit)) continue;
      const auto needed = entry.service->memory_bytes;
      if (!needed) {
        unknown.push_back(name);
      } else if (*needed > *model.memory_limit_bytes - held) {
        entry = {
            .service = std::nullopt,
            .reason = fmt::format("it needs {} MB of the {} of its memory_mb{}", megabytes(*needed),
                                  megabytes(*model.memory_limit_bytes),
                                  held == 0 ? ""
                                            : fmt::format(", of which {} has {}", join(holds, ", "),
                                                          megabytes(held)))};
        services.warnings.push_back(
            fmt::format("{} is not prepared on {}: {}", name, model.name, entry.reason));
      } else if (!model.contexts) {
        held += *needed;
        holds.push_back(name);
      }
    }
    if (unknown.empty()) continue;
    services.warnings.push_back(fmt::format(
        "nobody has measured what {} needs of the memory of {}: it is not counted in memory_mb",
        join(unknown, ", "), model.name));
  }
}

/// Leaves of the units that `eligible` names those that have a service. One whose figure is
/// uncertain by more than a factor of 4 is among them only where nothing else of the robot's own
/// is, and warned of; the cloud is asked for other reasons than its time.
/// @param only  The role whose units alone the mode uses, if it has one: others serve nothing.
void narrow_classes(std::optional<Role> only, Scenario& scenario) {
  const Platform& platform = scenario.platform;
  auto& warnings = scenario.services.warnings;
  for (std::size_t p = 0; p < scenario.classes.size(); ++p) {
    const Pipeline& pipeline = scenario.mix.pipelines[p];
    for (std::size_t t = 0; t < pipeline.tasks.size(); ++t) {
      const MixTask& task = pipeline.tasks[t];
      TaskClass& kind = scenario.classes[p][t];
      const UnitMask served = scenario.services.units_of(kind.workload);
      kind.eligible &= served;
      if (kind.eligible == 0) {
        throw_bad_input(task_name(scenario.mix, pipeline, task) + ": eligible [" +
                        join(task.eligible, ", ") + "] leaves no unit for " + task.workload +
                        ", which " + unit_list(platform, served) + " of platform " + platform.name +
                        " can serve");
      }
      const UnitMask left_out =
          too_uncertain(platform, scenario.services, kind.workload, kind.eligible, only);
      if (left_out == 0) continue;
      kind.eligible &= ~left_out;
      std::string warning =
          task.workload + " on " + unit_list(platform, left_out) +
          " is not used: its figure is uncertain by more than a factor of 4, and another unit "
          "serves it";
      if (std::ranges::find(warnings, warning) == warnings.end()) {
        warnings.push_back(std::move(warning));
      }
    }
  }
}

}  // namespace

void Scenario::keep_calls_whole() {
  slices = false;
  for (auto& row : services.entries) {
    for (ServiceEntry& entry : row) {
      if (entry.service) entry.service->slices.clear();
    }
  }
}

Scenario make_scenario(const Platform& platform, const Profile* profile, const Mix& mix,
                       ServiceOptions options, CloudUse cloud_use) {
  options.given = given_services(platform, mix);
  Scenario scenario{.platform = platform,
                    .mix = mix,
                    .services = resolve_services(platform, profile, workloads_of(mix), options),
                    .classes = {},
                    .slices = options.slices};
  scenario.classes = named_classes(platform, mix, scenario.services);
  admit_by_memory(scenario);
  check_every_workload_served(scenario, profile, cloud_use);
  narrow_classes(options.only, scenario);
  return scenario;
}

}  // namespace pirt
