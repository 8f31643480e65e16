#include "characterize/machine/host_load.h"

#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include "characterize/machine/system_files.h"
#include "workloads/base/system/control_groups.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr double kContendedShare = 0.05;
constexpr double kCrowdedShare = 0.25;
constexpr double kThrottledShare = 0.01;

Nanos tick() { return Nanos(1'000'000'000 / ::sysconf(_SC_CLK_TCK)); }

struct CoreTimes {
  Nanos busy{0}, total{0}, steal{0};
};

/// The fields user nice system idle iowait irq softirq steal; busy is all but idle and iowait
/// (guest time is counted within user). @source proc_stat(5).
void add_fields(std::istringstream& fields, CoreTimes& times) {
  std::int64_t value = 0;
  for (int i = 0; i < 8 && fields >> value; ++i) {
    const Nanos time = value * tick();
    times.total += time;
    if (i != 3 && i != 4) times.busy += time;
    if (i == 7) times.steal += time;
  }
}

std::optional<CoreTimes> read_times(const std::vector<int>& cores,
                                    const std::filesystem::path& root) {
  std::ifstream in(root / "proc/stat");
  std::string line;
  std::optional<CoreTimes> times;
  while (std::getline(in, line)) {
    std::istringstream fields(line);
    std::string name;
    fields >> name;
    if (!name.starts_with("cpu")) break;
    const bool wanted = cores.empty() ? name == "cpu" : std::ranges::any_of(cores, [&](int core) {
      return name == "cpu" + std::to_string(core);
    });
    if (!wanted) continue;
    if (!times) times.emplace();
    add_fields(fields, *times);
  }
  return times;
}

/// Whether a cooling device slows a processor down, as its type says. @source cpufreq_cooling.c
/// (new and old), devfreq_cooling.c, cpuidle_cooling.c (new and old), the ACPI processor's driver,
/// intel_powerclamp.c (thermald's), and the balanced throttling of L4T's kernels 3.10, 4.4 and 4.9.
bool slows(const std::string& type) {
  const auto has = [&type](const char* part) { return type.find(part) != std::string::npos; };
  return has("cpufreq") || has("devfreq") || has("thermal-idle") || type.starts_with("idle-") ||
         type.ends_with("-balanced") || type == "tegra-heavy" || type == "intel_powerclamp" ||
         type == "Processor";
}

/// Boards of Arm count no thermal events: their kernels limit the clock by cooling devices.
/// @source Documentation/driver-api/thermal/sysfs-api: cur_state, 0 = not active;
/// stats/total_trans, how often it changed, where the kernel counts that.
std::optional<std::int64_t> sum_of_coolers(const std::filesystem::path& root, const char* file) {
  std::optional<std::int64_t> total;
  for (const auto& device : folder_entries(root / "sys/class/thermal")) {
    if (!slows(first_line(device / "type").value_or(""))) continue;
    const auto value = read_number(device / file);
    // intel_powerclamp is at -1 while it is off.
    if (value) total = total.value_or(0) + std::max<std::int64_t>(0, *value);
  }
  return total;
}

/// Firmware of a Raspberry Pi tells nobody but this driver. Its other file, get_throttled, has
/// more, but who reads it makes newer kernels warn. @source Documentation/hwmon/raspberrypi-hwmon.
bool has_low_voltage(const std::filesystem::path& root) {
  return std::ranges::any_of(folder_entries(root / "sys/class/hwmon"), [](const auto& device) {
    return first_line(device / "name") == "rpi_volt" &&
           read_number(device / "in0_lcrit_alarm").value_or(0) != 0;
  });
}

std::optional<std::int64_t> read_heat(const std::vector<int>& cores,
                                      const std::filesystem::path& root) {
  const auto folder = root / "sys/devices/system/cpu";
  std::optional<std::int64_t> total;
  for (const int core : cores.empty() ? numbered_folders(folder, "cpu") : cores) {
    // Where its package is at its limit, a core is slowed down without being hot itself.
    for (const char* file : {"core_throttle_count", "package_throttle_count"}) {
      const auto count =
          read_number(folder / ("cpu" + std::to_string(core)) / "thermal_throttle" / file);
      if (count) total = total.value_or(0) + *count;
    }
  }
  return total ? total : sum_of_coolers(root, "stats/total_trans");
}

std::optional<std::int64_t> read_max_khz(const std::vector<int>& cores,
                                         const std::filesystem::path& root) {
  const auto folder = root / "sys/devices/system/cpu";
  std::optional<std::int64_t> total;
  for (const int core : cores.empty() ? numbered_folders(folder, "cpu") : cores) {
    const auto limit =
        read_number(folder / ("cpu" + std::to_string(core)) / "cpufreq/scaling_max_freq");
    if (limit) total = total.value_or(0) + *limit;
  }
  return total;
}

/// Version 2 counts microseconds, version 1 nanoseconds. @source
/// Documentation/admin-guide/cgroup-v2, Documentation/scheduler/sched-bwc.
std::optional<Nanos> read_quota_wait(const std::filesystem::path& root) {
  std::optional<Nanos> sum;  // each group around the process may hold it back
  for (const auto& folder : control_groups(root, "cpu")) {
    const auto path = folder / "cpu.stat";
    std::optional<Nanos> waited;
    if (const auto us = number_of(path, "throttled_usec", ' ')) {
      waited = std::chrono::microseconds(*us);
    } else if (const auto ns = number_of(path, "throttled_time", ' ')) {
      waited = Nanos(*ns);
    }
    if (waited) sum = sum.value_or(Nanos(0)) + *waited;
  }
  return sum;
}

/// The second of three numbers of each thread: nanoseconds on a queue of the scheduler's. Those
/// that have ended are not counted. @source Documentation/scheduler/sched-stats.
std::optional<Nanos> read_waited(const std::filesystem::path& root) {
  std::optional<Nanos> waited;
  std::error_code gone;
  for (const auto& thread : std::filesystem::directory_iterator(root / "proc/self/task", gone)) {
    std::ifstream in(thread.path() / "schedstat");
    std::int64_t ran = 0, queued = 0;
    if (in >> ran >> queued) waited = waited.value_or(Nanos(0)) + Nanos(queued);
  }
  return waited;
}

/// The limit of one group in cores; 0 = none; absent if the folder has no such files.
std::optional<double> quota_of(const std::filesystem::path& folder) {
  // Version 2: "150000 100000" or "max 100000"; version 1 has a file for each, -1 for no limit.
  if (const auto line = first_line(folder / "cpu.max")) {
    const auto parts = split(*line, ' ');
    if (parts.front() == "max") return 0;
    if (parts.size() != 2) return std::nullopt;
    const double quota = std::strtod(parts[0].c_str(), nullptr);
    const double period = std::strtod(parts[1].c_str(), nullptr);
    return quota > 0 && period > 0 ? std::optional(quota / period) : std::nullopt;
  }
  const auto quota = read_number(folder / "cpu.cfs_quota_us");
  const auto period = read_number(folder / "cpu.cfs_period_us");
  if (!quota || !period || *period <= 0) return std::nullopt;
  return *quota < 0 ? 0 : static_cast<double>(*quota) / static_cast<double>(*period);
}

Nanos process_time() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  rusage children{};
  ::getrusage(RUSAGE_CHILDREN, &children);
  Nanos sum = std::chrono::seconds(time.tv_sec) + Nanos(time.tv_nsec);
  for (const timeval& part : {children.ru_utime, children.ru_stime}) {
    sum += std::chrono::seconds(part.tv_sec) + std::chrono::microseconds(part.tv_usec);
  }
  return sum;
}

}  // namespace

HostCounters read_host_counters(const std::vector<int>& cores, const std::filesystem::path& root) {
  HostCounters counters;
  counters.at = std::chrono::steady_clock::now().time_since_epoch();
  if (const auto times = read_times(cores, root)) {
    counters.busy = times->busy;
    counters.total = times->total;
    counters.steal = times->steal;
  }
  counters.own = process_time();
  counters.waited = read_waited(root);
  counters.heat_events = read_heat(cores, root);
  counters.cooled = sum_of_coolers(root, "cur_state");
  counters.max_khz = read_max_khz(cores, root);
  counters.low_voltage = has_low_voltage(root);
  counters.quota_wait = read_quota_wait(root);
  return counters;
}

std::optional<double> read_cpu_quota(const std::filesystem::path& root) {
  std::optional<double> tightest;
  for (const auto& folder : control_groups(root, "cpu")) {
    const auto cores = quota_of(folder);
    if (!cores) continue;
    const bool tighter = *cores > 0 && (tightest.value_or(0) == 0 || *cores < *tightest);
    if (!tightest || tighter) tightest = cores;
  }
  return tightest;
}

namespace {

bool was_throttled(const HostCounters& before, const HostCounters& after) {
  const double wall_s = to_s(after.at - before.at);
  const bool heat =
      before.heat_events && after.heat_events && *after.heat_events > *before.heat_events;
  const bool quota = before.quota_wait && after.quota_wait &&
                     to_s(*after.quota_wait - *before.quota_wait) > kThrottledShare * wall_s;
  const bool cooled = std::max(before.cooled.value_or(0), after.cooled.value_or(0)) > 0;
  const bool limited = before.max_khz && after.max_khz && *after.max_khz != *before.max_khz;
  return heat || quota || cooled || limited || before.low_voltage || after.low_voltage;
}

}  // namespace

Interference interference(const HostCounters& before, const HostCounters& after, int core_count) {
  Interference result;
  const double wall_s = to_s(after.at - before.at);
  if (before.busy && after.busy) {
    const Nanos others = (*after.busy - *before.busy) - (after.own - before.own);
    if (wall_s > 0) result.others = std::max(0.0, to_s(others) / wall_s);
    // Busy time is counted in ticks, so each core's difference can be off by one at either end.
    const double grain_s = 2 * to_s(tick()) * core_count;
    const auto exceed = [&](double share) {
      return to_s(others) > std::max(share * wall_s * core_count, grain_s);
    };
    result.contended = exceed(kContendedShare);
    result.crowded = exceed(kCrowdedShare);
  }
  result.throttled = was_throttled(before, after);
  return result;
}

Interference interference_elsewhere(const HostCounters& before, const HostCounters& after,
                                    Nanos answering) {
  Interference result;
  const double wall_s = to_s(after.at - before.at);
  if (before.waited && after.waited) {
    Nanos waited = *after.waited - *before.waited;
    if (before.busy && after.busy) {
      waited = std::min(waited, *after.busy - *before.busy - (after.own - before.own) - answering);
    }
    const double grain_s = before.busy && after.busy ? 2 * to_s(tick()) : 0;
    const auto exceed = [&](double share) {
      return to_s(waited) > std::max(share * wall_s, grain_s);
    };
    result.contended = exceed(kContendedShare);
    result.crowded = exceed(kCrowdedShare);
  }
  result.throttled = was_throttled(before, after);
  return result;
}

}  // namespace pirt
