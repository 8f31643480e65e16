#include "characterize/doctor/doctor.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>

#include "characterize/doctor/doctor_checks.h"
#include "characterize/energy/meter.h"
#include "characterize/machine/system_files.h"
#include "characterize/worker/job_runner.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/base/time.h"

namespace pirt {
namespace doctor {

Findings build(const DoctorInput& input) {
  const auto type = input.build.find("build_type");
  const auto sanitizers = input.build.find("sanitizers");
  const std::string name = type == input.build.end() ? "no build type" : type->second;
  const bool instrumented = sanitizers != input.build.end() && sanitizers->second != "none";
  if (!instrumented && (name == "Release" || name == "RelWithDebInfo" || name == "MinSizeRel")) {
    return {good("build", name)};
  }
  return {{"build", Level::kSpoils,
           instrumented ? fmt::format("{} with sanitizers {}", name, sanitizers->second) : name,
           "unoptimized or instrumented code is several times slower",
           "cmake --preset release && cmake --build --preset release"}};
}

Findings units(const DoctorInput& input) {
  if (!input.units) return {unknown("units", "not probed: this is a recorded machine")};
  const bool none =
      std::ranges::none_of(*input.units, [](const auto& u) { return u.error.empty(); });
  Findings findings;
  for (const UnitProbe& unit : *input.units) {
    const std::string check = "unit " + unit.unit;
    if (unit.error.empty()) {
      findings.push_back(good(check, unit.device));
    } else {
      findings.push_back({check, none ? Level::kBlocks : Level::kSpoils, "not available",
                          none ? "there is no unit to measure" : "the unit will have no figures",
                          unit.error});
    }
  }
  return findings;
}

/// All that `pirt list meters` finds.
Findings energy_meter(const DoctorInput& input) {
  const auto note = [](const std::string& found, const std::string& remedy) -> Findings {
    return {
        {"energy_meter", Level::kNote, found, "energy is modelled instead of measured", remedy}};
  };
  const MeterDiscovery found = discover_meters(input.root / "sys");
  std::vector<std::string> readable;
  std::string rapl, problem;
  for (const auto& meter : found.meters) {
    const MeterInfo& info = meter->info();
    if (info.driver == "nvml" && !input.inherited) continue;  // Not of a recorded machine.
    const bool may_be_read = info.driver == "nvml" || input.readable(info.path);  // No file.
    if (info.problem.empty() && may_be_read) {
      readable.push_back(info.name);
    } else if (info.driver == "rapl" && !may_be_read) {
      rapl = "RAPL is there and may not be read";
    } else if (problem.empty()) {
      problem = info.name + ": " + (info.problem.empty() ? "may not be read" : info.problem);
    }
  }
  if (!readable.empty()) {
    return {good("energy_meter", join(readable, ", ") + " can be read (pirt list meters)" +
                                     (rapl.empty() ? "" : "; " + rapl))};
  }
  if (!rapl.empty()) {
    return note(rapl,
                "sudo chmod a+r /sys/class/powercap/*/energy_uj (until the next start), or run as "
                "root");
  }
  if (!problem.empty()) return note(problem, "pirt list meters says more");
  return {unknown("energy_meter",
                  "no RAPL, INA3221, hwmon sensor or discharging battery in /sys (most virtual "
                  "machines have none), and no board of NVIDIA's")};
}

Findings disk(const DoctorInput& input) {
  // A full profile database takes 2 MB, the references of all workloads 60 MB.
  constexpr std::int64_t kEnough = std::int64_t{200} << 20;
  Findings findings;
  for (const DiskSpace& space : input.disks) {
    if (!space.free_bytes) {
      findings.push_back(unknown("disk", fmt::format("{}: the system does not say", space.folder)));
      continue;
    }
    const std::string found =
        fmt::format("{} MB free in {}", *space.free_bytes >> 20, space.folder);
    if (*space.free_bytes >= kEnough) {
      findings.push_back(good("disk", found));
    } else {
      findings.push_back({"disk", Level::kSpoils, found, "references and figures cannot be written",
                          fmt::format("free some space there (du -x -d1 -h {} | sort -h), or set "
                                      "TMPDIR for scratch files",
                                      space.folder)});
    }
  }
  return findings;
}

Findings new_code(const DoctorInput& input) {
  if (!input.inherited) return {};  // a recorded machine
  if (input.no_new_code.empty()) return {good("new_code", "drivers can compile and load kernels")};
  const auto end = input.no_new_code.find("; ");
  return {{"new_code", Level::kSpoils, input.no_new_code.substr(0, end),
           "kernels that are compiled on this machine have no figures",
           input.no_new_code.substr(end + 2)}};
}

Findings inherited(const DoctorInput& input) {
  if (!input.inherited) return {};
  std::vector<std::string> found, names;
  for (const auto& [key, value] : *input.inherited) {
    const bool variable = key.starts_with("env.");
    found.push_back(variable ? key.substr(4) + "=" + value : value);
    if (variable) names.push_back(key.substr(4));
  }
  if (found.empty()) return {good("inherited", "no variable or priority that changes the speed")};
  return {{"inherited", Level::kNote, join(found, ", "),
           "figures are those of libraries and drivers that obey this; runs without it are not "
           "comparable",
           names.empty() ? "start pirt from a shell that has the usual priority"
                         : "unset " + join(names, " ")}};
}

}  // namespace doctor

std::string_view to_string(Level level) {
  constexpr std::array<std::string_view, 5> kNames = {"good", "unknown", "note", "spoils",
                                                      "blocks"};
  return kNames.at(static_cast<std::size_t>(level));
}

DoctorSnapshot read_doctor_snapshot(const std::vector<int>& cores,
                                    const std::filesystem::path& root) {
  DoctorSnapshot snapshot;
  snapshot.host = read_host_counters(cores, root);
  const auto in = number_of(root / "proc/vmstat", "pswpin", ' ');
  const auto out = number_of(root / "proc/vmstat", "pswpout", ' ');
  if (in && out) snapshot.swapped_pages = *in + *out;
  // "some avg10=0.00 avg60=0.00 avg300=0.00 total=123". @source Documentation/accounting/psi.
  if (const auto line = first_line(root / "proc/pressure/memory")) {
    const auto at = line->find("total=");
    if (at != std::string::npos) {
      snapshot.memory_stall = std::chrono::microseconds(std::atoll(line->c_str() + at + 6));
    }
  }
  return snapshot;
}

std::vector<int> recorded_cores(const std::filesystem::path& root) {
  auto cores = numbered_folders(root / "sys/devices/system/cpu", "cpu");
  if (!cores.empty()) return cores;
  std::ifstream in(root / "proc/cpuinfo");
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("processor")) cores.push_back(static_cast<int>(cores.size()));
  }
  return cores;
}

std::vector<UnitProbe> probe_units(const Platform& platform, const std::filesystem::path& program) {
  const JobRunner runner(program, std::chrono::seconds(60), nullptr);
  std::vector<UnitProbe> probes;
  for (const UnitModel& unit : platform.units) {
    if (!unit.measured()) continue;
    const JobResult found = probe_unit(runner, platform, unit);
    UnitProbe probe{.unit = unit.name, .device = {}, .error = found.error, .cores = unit.cores};
    if (found.device) probe.device = found.device->name;
    // What is out of reach is opened all the same: it may come.
    if (found.device && unit.role == Role::kCloud) probe.error = found.device->remark;
    probes.push_back(std::move(probe));
  }
  if (probes.empty()) {
    throw_bad_input(fmt::format(
        "platform '{}' has no unit to measure (no unit names a backend); try --platform host",
        platform.name));
  }
  return probes;
}

DiskSpace free_space(const std::filesystem::path& folder) {
  std::error_code failed;
  const auto space = std::filesystem::space(folder, failed);
  if (failed) return {folder.string(), std::nullopt};
  return {folder.string(), static_cast<std::int64_t>(space.available)};
}

std::vector<Finding> look_before_measuring(DoctorInput input, Nanos duration) {
  input.jitter = measure_jitter(input.cores, duration);
  input.after = read_doctor_snapshot(input.cores, input.root);
  return spoiling(diagnose(input));
}

std::vector<Finding> spoiling(std::vector<Finding> findings) {
  std::erase_if(findings, [](const Finding& finding) { return finding.level != Level::kSpoils; });
  return findings;
}

std::vector<Finding> diagnose(const DoctorInput& input) {
  using namespace doctor;
  constexpr std::array kChecks = {
      build,        units,  gpus,     cores,           siblings, load,     steal,
      jitter,       quota,  governor, frequency_limit, turbo,    heat,     power_supply,
      clock_source, memory, swapping, energy_meter,    disk,     new_code, inherited};
  std::vector<Finding> findings;
  for (const auto& check : kChecks) {
    for (Finding& finding : check(input)) findings.push_back(std::move(finding));
  }
  return findings;
}

Level verdict(const std::vector<Finding>& findings) {
  Level worst = Level::kGood;
  for (const Finding& finding : findings) {
    if (finding.level >= Level::kSpoils) worst = std::max(worst, finding.level);
  }
  return worst;
}

}  // namespace pirt
