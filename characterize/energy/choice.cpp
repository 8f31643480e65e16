#include "characterize/energy/choice.h"

#include <fmt/core.h>

#include <algorithm>
#include <set>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using Meters = std::vector<const Meter*>;

Meters of_domain(const MeterDiscovery& found, MeterDomain domain) {
  Meters meters;
  for (const auto& meter : found.meters) {
    if (meter->info().domain == domain) meters.push_back(meter.get());
  }
  return meters;
}

/// Of the packages that own one of @p cores; all where that is not known.
Meters packages_of(const MeterDiscovery& found, const std::vector<int>& cores,
                   const std::filesystem::path& sys) {
  Meters all = of_domain(found, MeterDomain::kPackage);
  if (all.empty()) return all;
  // Several drivers tell the same joules: RAPL and amd_energy, or the sensor of an APU. The first
  // that may be read, or else the first.
  const auto readable =
      std::ranges::find_if(all, [](const Meter* meter) { return meter->info().problem.empty(); });
  const std::string driver = (readable == all.end() ? all.front() : *readable)->info().driver;
  std::erase_if(all, [&driver](const Meter* meter) { return meter->info().driver != driver; });
  std::set<std::string> owners;
  for (const int core : cores) {
    const auto package = read_integer(
        sys / fmt::format("devices/system/cpu/cpu{}/topology/physical_package_id", core));
    if (package.value) owners.insert(fmt::format("package-{}", *package.value));
  }
  if (owners.empty()) return all;
  Meters chosen;
  std::ranges::copy_if(all, std::back_inserter(chosen), [&](const Meter* meter) {
    const std::string& name = meter->info().name;  // "package-0", or "package-0-die-1"
    return owners.contains(name.substr(0, name.find("-die-")));
  });
  return chosen.empty() ? all : chosen;
}

/// Those of the device's own board; of a device or a meter that does not say which, all the same.
Meters gpus_of(const MeterDiscovery& found, const std::string& pci) {
  Meters all = of_domain(found, MeterDomain::kGpu);
  Meters own = all;
  std::erase_if(own, [&](const Meter* meter) { return meter->info().pci != pci; });
  if (pci.empty() || !own.empty()) return pci.empty() ? all : own;
  std::erase_if(all, [](const Meter* meter) { return !meter->info().pci.empty(); });
  return all;
}

/// The first of several is taken only where one must contain the others.
Meters single(const Meters& meters) { return meters.size() == 1 ? meters : Meters(); }

std::string problem_of(const Meters& meters) {
  for (const Meter* meter : meters) {
    if (!meter->info().problem.empty()) return meter->info().name + ": " + meter->info().problem;
  }
  return "";
}

MeterChoice named(const MeterDiscovery& found, const UnitModel& unit) {
  Meters meters = find_meters(found, unit.meter);
  const std::string problem = problem_of(meters);
  if (!problem.empty()) {
    throw_environment(fmt::format("unit '{}' has meter '{}', which cannot be read: {}", unit.name,
                                  unit.meter, problem));
  }
  return {std::move(meters), ""};
}

}  // namespace

MeterChoice choose_meters(const MeterDiscovery& found, const MeterUser& user,
                          const std::filesystem::path& sys) {
  if (user.unit.meter == "none") return {};
  if (!user.unit.meter.empty()) return named(found, user.unit);
  if (user.simulated) return {};
  const Meters board = single(of_domain(found, MeterDomain::kBoard));
  const Meters battery = single(of_domain(found, MeterDomain::kBattery));
  const Meters own = user.device_is_cpu ? packages_of(found, user.unit.cores, sys)
                                        : single(gpus_of(found, user.pci));
  // A card whose own meter is known has no other: the board's input is of all the machine's.
  const bool is_known = !user.pci.empty() && !own.empty() && own.front()->info().pci == user.pci;
  const auto candidates = is_known             ? std::vector<Meters>{own}
                          : user.device_is_cpu ? std::vector<Meters>{own, board, battery}
                                               : std::vector<Meters>{board, own, battery};
  MeterChoice choice;
  std::vector<std::string> problems;
  for (const Meters& meters : candidates) {
    if (meters.empty()) continue;
    const std::string problem = problem_of(meters);
    if (problem.empty()) {
      choice.meters = meters;
      break;
    }
    problems.push_back(problem);
  }
  const std::string without = user.has_model ? "modelled" : "not known";
  if (!problems.empty()) {
    const std::string instead =
        choice.meters.empty() ? without : "read from " + choice.meters.front()->info().name;
    choice.remark =
        fmt::format("energy of unit {} is {}: {}", user.unit.name, instead, join(problems, "; "));
  } else if (choice.meters.empty() && !found.meters.empty()) {
    choice.remark = fmt::format(
        "energy of unit {} is {}: none of the meters {} clearly covers it; name one, or a "
        "sum "
        "of them, with --set {}.meter=NAME",
        user.unit.name, without, join(found.names(), ", "), user.unit.name);
  } else if (choice.meters.empty() && !user.has_model && !user.device_is_cpu) {
    choice.remark = fmt::format(
        "energy of unit {} is not known: its device has no meter{}; give it with --set "
        "{}.active_w=W",
        user.unit.name,
        user.unit.watts_of_host_cores ? ", and the platform's watts are of the host's cores" : "",
        user.unit.name);
  }
  const auto is_guess = [&](const Meter* meter) {
    return !meter->info().pci.empty() && meter->info().pci != user.pci;
  };
  if (choice.remark.empty() && std::ranges::any_of(choice.meters, is_guess)) {
    choice.remark = fmt::format(
        "energy of unit {} is read from {}, the only board with a meter: its driver does not say "
        "which one it is; name another with --set {}.meter=NAME",
        user.unit.name, choice.meters.front()->info().name, user.unit.name);
  }
  return choice;
}

}  // namespace pirt
