#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <map>

#include "characterize/doctor/doctor_checks.h"
#include "characterize/machine/system_files.h"

namespace pirt::doctor {
namespace {

std::filesystem::path cpu_folder(const DoctorInput& input) {
  return input.root / "sys/devices/system/cpu";
}

std::filesystem::path cpufreq(const DoctorInput& input, int core) {
  return cpu_folder(input) / ("cpu" + std::to_string(core)) / "cpufreq";
}

constexpr const char* kNoCpufreq =
    "no cpufreq in /sys: a virtual machine or a fixed clock; the host decides";

}  // namespace

Findings governor(const DoctorInput& input) {
  std::map<std::string, std::vector<int>> others;
  bool any = false;
  for (const int core : input.cores) {
    const auto name = first_line(cpufreq(input, core) / "scaling_governor");
    if (!name) continue;
    any = true;
    if (*name != "performance") others[*name].push_back(core);
  }
  if (!any) return {unknown("governor", kNoCpufreq)};
  if (others.empty()) return {good("governor", "performance on all cores")};
  std::string found;
  for (const auto& [name, list] : others) {
    found += fmt::format("{}{} on cores {}", found.empty() ? "" : ", ", name, fmt::join(list, ","));
  }
  return {{"governor", Level::kSpoils, found,
           "the clock follows the load, and short calls run slow",
           "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"}};
}

Findings frequency_limit(const DoctorInput& input) {
  const auto percent = read_number(cpu_folder(input) / "intel_pstate" / "max_perf_pct");
  if (percent && *percent < 100) {
    return {{"frequency_limit", Level::kNote,
             fmt::format("all cores are limited to {} % of their highest clock", *percent),
             "figures are those of a slower machine",
             "echo 100 | sudo tee /sys/devices/system/cpu/intel_pstate/max_perf_pct"}};
  }
  bool any = false;
  for (const int core : input.cores) {
    const auto limit = read_number(cpufreq(input, core) / "scaling_max_freq");
    const auto able = read_number(cpufreq(input, core) / "cpuinfo_max_freq");
    if (!limit || !able) continue;
    any = true;
    if (*limit >= *able) continue;
    return {{"frequency_limit", Level::kNote,
             fmt::format("core {} is limited to {} of {} MHz", core, *limit / 1000, *able / 1000),
             "figures are those of a slower machine",
             fmt::format("echo {} | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_max_freq",
                         *able)}};
  }
  if (!any) return {unknown("frequency_limit", kNoCpufreq)};
  return {good("frequency_limit", "none below the hardware's")};
}

Findings turbo(const DoctorInput& input) {
  const auto found = read_turbo(input.root);
  if (!found) return {unknown("turbo", "neither intel_pstate nor cpufreq/boost in /sys")};
  if (!found->on) return {good("turbo", "off")};
  return {{"turbo", Level::kSpoils, "on",
           "the clock depends on heat and on how many cores are busy", found->remedy}};
}

Findings heat(const DoctorInput& input) {
  constexpr double kHot = 85;  // degrees; most processors slow down between 95 and 105
  const HostCounters& before = input.before.host;
  const HostCounters& after = input.after ? input.after->host : before;
  const auto slowed = [](const std::string& found) {
    return Finding{"heat", Level::kSpoils, found, "the clock falls while something is timed",
                   "let the machine cool, improve its cooling"};
  };
  if (after.heat_events.value_or(0) > before.heat_events.value_or(0)) {
    return {slowed("cores were slowed down for heat while doctor looked")};
  }
  if (const auto steps = std::max(before.cooled.value_or(0), after.cooled.value_or(0)); steps > 0) {
    return {
        slowed(fmt::format("processors are slowed down for heat, by {} steps of what cools "
                           "them (cooling_device*/cur_state)",
                           steps))};
  }
  if (before.max_khz && after.max_khz && *before.max_khz != *after.max_khz) {
    return {
        slowed(fmt::format("the limit of the cores' clocks, all together, went from {} to {} "
                           "MHz while doctor looked",
                           *before.max_khz / 1000, *after.max_khz / 1000))};
  }
  const Environment facts = host_environment(input.root);
  const auto temperature = facts.find("temperature_c");
  if (temperature == facts.end()) {
    if (before.heat_events) return {good("heat", "no throttling counted")};
    return {unknown("heat", facts.at("temperature_c_unknown"))};
  }
  const std::string found = temperature->second + " degrees C in the hottest zone";
  if (std::stod(temperature->second) < kHot) return {good("heat", found)};
  return {{"heat", Level::kNote, found, "little is left before the clock is lowered",
           "let the machine cool, improve its cooling"}};
}

Findings power_supply(const DoctorInput& input) {
  if (input.before.host.low_voltage || (input.after && input.after->host.low_voltage)) {
    return {{"power_supply", Level::kSpoils, "its voltage is too low (rpi_volt: in0_lcrit_alarm)",
             "the firmware lowers the clock", "give the board a stronger supply"}};
  }
  std::error_code failed;
  bool mains = false, online = false, battery = false, outlet = false;
  const auto folder = input.root / "sys/class/power_supply";
  for (const auto& supply : std::filesystem::directory_iterator(folder, failed)) {
    const auto type = first_line(supply.path() / "type");
    if (!type) continue;
    mains = mains || *type == "Mains";
    outlet = outlet || *type == "Mains" || *type == "USB";
    online = online || read_number(supply.path() / "online").value_or(0) != 0;
    // That of a mouse is no battery of the machine's.
    battery = battery || (*type == "Battery" && first_line(supply.path() / "scope") != "Device" &&
                          read_number(supply.path() / "present").value_or(1) != 0);
  }
  // An empty USB port alone is no supply; a battery alone need not be what the machine runs on.
  if (!mains && !(outlet && (online || battery))) return {};
  if (online) return {good("power_supply", "on mains")};
  return {{"power_supply", Level::kSpoils, "on battery", "firmware and governor save power",
           "plug the machine in"}};
}

Findings clock_source(const DoctorInput& input) {
  const auto folder = input.root / "sys/devices/system/clocksource/clocksource0";
  const auto current = first_line(folder / "current_clocksource");
  if (!current) return {unknown("clock_source", "no clocksource in /sys")};
  // Those that a program reads without a system call (vDSO).
  constexpr std::array<std::string_view, 5> kFast = {
      "tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page", "riscv_clocksource"};
  for (const auto fast : kFast) {
    if (*current == fast) return {good("clock_source", *current)};
  }
  const auto available = first_line(folder / "available_clocksource").value_or("");
  const bool has_tsc = (" " + available + " ").find(" tsc ") != std::string::npos;
  return {{"clock_source", Level::kSpoils, *current,
           "each look at the clock is a system call of a microsecond or so",
           has_tsc ? "echo tsc | sudo tee "
                     "/sys/devices/system/clocksource/clocksource0/current_clocksource"
                   : "boot with tsc=reliable (the kernel found the processor's counter unstable: "
                     "dmesg | grep -i tsc)"}};
}

}  // namespace pirt::doctor
