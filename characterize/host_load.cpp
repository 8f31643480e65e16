#include "characterize/host_load.h"

#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <sstream>
#include <string>

namespace pirt {
namespace {

constexpr double kContendedShare = 0.05;
constexpr double kThrottledShare = 0.01;

Nanos tick() { return Nanos(1'000'000'000 / ::sysconf(_SC_CLK_TCK)); }

/// Sum of the fields user nice system idle iowait irq softirq steal but idle and iowait. @source
/// proc_stat(5).
std::int64_t busy_ticks(std::istringstream& fields) {
  std::int64_t sum = 0;
  std::int64_t value = 0;
  for (int i = 0; i < 8 && fields >> value; ++i) {
    if (i != 3 && i != 4) sum += value;
  }
  return sum;
}

std::optional<Nanos> read_busy(const std::vector<int>& cores, const std::filesystem::path& root) {
  std::ifstream in(root / "proc/stat");
  std::string line;
  std::optional<Nanos> total;
  while (std::getline(in, line)) {
    std::istringstream fields(line);
    std::string name;
    fields >> name;
    if (!name.starts_with("cpu")) break;
    const bool wanted = cores.empty() ? name == "cpu" : std::ranges::any_of(cores, [&](int core) {
      return name == "cpu" + std::to_string(core);
    });
    if (wanted) total = total.value_or(Nanos(0)) + busy_ticks(fields) * tick();
  }
  return total;
}

std::optional<std::int64_t> read_number(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::int64_t value = 0;
  if (in >> value) return value;
  return std::nullopt;
}

std::optional<std::int64_t> read_heat(const std::vector<int>& cores,
                                      const std::filesystem::path& root) {
  const auto folder = root / "sys/devices/system/cpu";
  std::optional<std::int64_t> total;
  const auto add = [&](const std::string& cpu) {
    const auto count = read_number(folder / cpu / "thermal_throttle/core_throttle_count");
    if (count) total = total.value_or(0) + *count;
  };
  for (const int core : cores) add("cpu" + std::to_string(core));
  if (cores.empty()) {
    const long configured = ::sysconf(_SC_NPROCESSORS_CONF);
    for (long core = 0; core < configured; ++core) add("cpu" + std::to_string(core));
  }
  return total;
}

/// Of control groups v2, in the process' own group or, seen from inside a container, at the root of
/// the tree.
std::optional<Nanos> read_quota_wait(const std::filesystem::path& root) {
  std::ifstream groups(root / "proc/self/cgroup");
  std::string line;
  std::filesystem::path group;
  while (std::getline(groups, line)) {
    if (line.starts_with("0::/")) group = line.substr(4);
  }
  for (const auto& folder : {root / "sys/fs/cgroup" / group, root / "sys/fs/cgroup"}) {
    std::ifstream in(folder / "cpu.stat");
    std::string key;
    std::int64_t value = 0;
    while (in >> key >> value) {
      if (key == "throttled_usec") return std::chrono::microseconds(value);
    }
  }
  return std::nullopt;
}

Nanos process_time() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return std::chrono::seconds(time.tv_sec) + Nanos(time.tv_nsec);
}

}  // namespace

HostCounters read_host_counters(const std::vector<int>& cores, const std::filesystem::path& root) {
  HostCounters counters;
  counters.at = std::chrono::steady_clock::now().time_since_epoch();
  counters.busy = read_busy(cores, root);
  counters.own = process_time();
  counters.heat_events = read_heat(cores, root);
  counters.quota_wait = read_quota_wait(root);
  return counters;
}

Interference interference(const HostCounters& before, const HostCounters& after, int core_count) {
  Interference result;
  const double wall_s = to_s(after.at - before.at);
  if (before.busy && after.busy) {
    const Nanos others = (*after.busy - *before.busy) - (after.own - before.own);
    // Busy time is counted in ticks, so each core's difference can be off by one at either end.
    const double grain_s = 2 * to_s(tick()) * core_count;
    result.contended = to_s(others) > std::max(kContendedShare * wall_s * core_count, grain_s);
  }
  const bool heat =
      before.heat_events && after.heat_events && *after.heat_events > *before.heat_events;
  const bool quota = before.quota_wait && after.quota_wait &&
                     to_s(*after.quota_wait - *before.quota_wait) > kThrottledShare * wall_s;
  result.throttled = heat || quota;
  return result;
}

}  // namespace pirt
