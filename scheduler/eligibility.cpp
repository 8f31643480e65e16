#include "scheduler/eligibility.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "workloads/base/error.h"
#include "workloads/base/text.h"

namespace pirt {
namespace {

constexpr std::array<std::string_view, 6> kRoles = {"cpu", "gpu", "dsp", "fpga", "cloud", "other"};

bool is_cloud(const Platform& platform, UnitId unit) {
  return platform.units[unit].role == "cloud";
}

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

/// Whether some task of the workload has to be served on the robot.
bool needed_locally(const Mix& mix, const std::string& workload, bool offloads) {
  return std::ranges::any_of(mix.pipelines, [&](const Pipeline& pipeline) {
    return (pipeline.real_time || !offloads) &&
           std::ranges::find(pipeline.tasks, workload, &MixTask::workload) != pipeline.tasks.end();
  });
}

/// What to do about workloads that no unit serves.
std::string remedy(const Platform& platform, const Profile* profile,
                   const std::vector<std::string>& missing) {
  if (std::ranges::none_of(platform.units, &UnitModel::measured)) {
    return "give their stages under `workloads:` in the platform file";
  }
  const std::string path = profile == nullptr ? "profile.db" : profile->path;
  return "measure with: pirt characterize --platform " + platform.name + " --filter '^(" +
         join(missing, "|") + ")$' --db " + path +
         (profile == nullptr ? ", then give --profile " + path : "");
}

/// The units that a list of names stands for.
UnitMask named_units(const Platform& platform, const std::vector<std::string>& names,
                     const std::string& where) {
  UnitMask mask = 0;
  for (const auto& name : names) {
    bool known = std::ranges::find(kRoles, name) != kRoles.end();
    for (UnitId unit = 0; unit < platform.units.size(); ++unit) {
      if (platform.units[unit].name != name && platform.units[unit].role != name) continue;
      mask |= unit_bit(unit);
      known = true;
    }
    if (known) continue;
    auto candidates = platform.unit_names();
    candidates.insert(candidates.end(), kRoles.begin(), kRoles.end());
    throw_bad_input(fmt::format("{}: eligible: '{}' is neither a unit of platform {} nor a role{}",
                                where, name, platform.name, suggestion(name, candidates)));
  }
  return mask;
}

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

}  // namespace

std::vector<std::string> workloads_of(const Mix& mix) {
  std::vector<std::string> names;
  for (const auto& pipeline : mix.pipelines) {
    for (const auto& task : pipeline.tasks) {
      if (std::ranges::find(names, task.workload) == names.end()) names.push_back(task.workload);
    }
  }
  return names;
}

void check_every_workload_served(const Platform& platform, const Profile* profile, const Mix& mix,
                                 const ServiceTable& services, bool offloads) {
  UnitMask cloud = 0;
  for (UnitId unit = 0; unit < platform.units.size(); ++unit)
    cloud |= is_cloud(platform, unit) ? unit_bit(unit) : 0;
  std::vector<std::string> missing;
  std::string reasons;
  for (WorkloadId workload = 0; workload < services.workloads.size(); ++workload) {
    const auto& name = services.workloads[workload];
    const UnitMask useless = needed_locally(mix, name, offloads) ? cloud : 0;
    if ((services.units_of(workload) & ~useless) != 0) continue;
    if (missing.empty()) reasons = join(unit_reasons(platform, services.entries[workload]), "; ");
    missing.push_back(name);
  }
  if (missing.empty()) return;
  throw_bad_input("mix " + mix.name + ": no unit of platform " + platform.name + " can serve " +
                  join(missing, ", ") + " (" + missing.front() + " - " + reasons + "); " +
                  remedy(platform, profile, missing));
}

std::vector<std::vector<TaskClass>> task_classes(const Platform& platform, const Mix& mix,
                                                 const ServiceTable& services) {
  std::vector<std::vector<TaskClass>> classes;
  for (const auto& pipeline : mix.pipelines) {
    auto& row = classes.emplace_back();
    for (const auto& task : pipeline.tasks) {
      const std::string where = task_name(mix, pipeline, task);
      const auto workload = static_cast<WorkloadId>(
          std::ranges::find(services.workloads, task.workload) - services.workloads.begin());
      const UnitMask served = services.units_of(workload);
      const UnitMask named =
          task.eligible.empty() ? served : named_units(platform, task.eligible, where);
      if ((served & named) == 0) {
        throw_bad_input(where + ": eligible [" + join(task.eligible, ", ") +
                        "] leaves no unit for " + task.workload + ", which " +
                        unit_list(platform, served) + " of platform " + platform.name +
                        " can serve");
      }
      row.push_back({.workload = workload,
                     .eligible = served & named,
                     .real_time = pipeline.real_time,
                     .image_input = task.image_input});
    }
  }
  return classes;
}

void check_every_task_placeable(const Platform& platform, const Mix& mix,
                                const std::vector<std::vector<TaskClass>>& classes,
                                const Policy& policy, const std::string& mode) {
  for (std::size_t p = 0; p < classes.size(); ++p) {
    for (std::size_t t = 0; t < classes[p].size(); ++t) {
      const TaskClass& kind = classes[p][t];
      if (policy.takers(kind, kind.eligible) != 0) continue;
      const auto& pipeline = mix.pipelines[p];
      throw_bad_input(task_name(mix, pipeline, pipeline.tasks[t]) + ": mode " + mode +
                      " would never place it: only " + unit_list(platform, kind.eligible) +
                      " may serve it, to which the mode gives no weight; give one with --weights, "
                      "or another mode");
    }
  }
}

}  // namespace pirt
