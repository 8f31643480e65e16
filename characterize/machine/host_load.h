// What else happened on the machine while something was timed: other programs on the same cores,
// steal, throttling.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

/// Counters at one moment; only differences mean something. Absent where the machine does not
/// count.
struct HostCounters {
  Nanos at{0};                 ///< Machine clock.
  std::optional<Nanos> busy;   ///< Of the cores asked for: everything but idle, steal included.
  std::optional<Nanos> total;  ///< Of the same cores: idle time as well.
  std::optional<Nanos> steal;  ///< Of the same cores: taken by the hypervisor for others.
  Nanos own{0};  ///< Processor time of this process, all threads, and of the children (a driver's
                 ///< compiler, say) that it has waited for.
  std::optional<Nanos> waited;  ///< How long threads of this process could run and had no core.
  /// Thermal throttling of the cores asked for; of boards whose kernels do not count that, changes
  /// of what slows any of their processors down.
  std::optional<std::int64_t> heat_events;
  std::optional<std::int64_t> cooled;   ///< Steps by which processors are slowed down for heat.
  std::optional<std::int64_t> max_khz;  ///< The sum of the cores' limits, which heat lowers.
  bool low_voltage = false;  ///< Of the supply, for which a board's firmware lowers the clock.
  /// Time that this process' control group and each one around it were held back by their quotas.
  std::optional<Nanos> quota_wait;
};

/// @param cores  The cores that count; empty = all.
/// @param root   Where /proc and /sys are found; another folder in tests.
[[nodiscard]] HostCounters read_host_counters(const std::vector<int>& cores,
                                              const std::filesystem::path& root = "/");

/// How many cores' worth of time this process' control group may use; 0 = no limit. Absent where no
/// such group is seen.
[[nodiscard]] std::optional<double> read_cpu_quota(const std::filesystem::path& root = "/");

struct Interference {
  bool contended = false;  ///< Others (or the hypervisor) used more than 5 % of the cores' time,
                           ///< and more than the counters' grain.
  bool crowded = false;    ///< The same of 25 %: what was timed may have waited for much of it.
  /// A thermal event, slowed down for heat, or held back by a quota for more than 1 % of the time.
  bool throttled = false;
  std::optional<double> others = {};  ///< What others used of the cores, in cores; absent = not
                                      ///< known.
  friend bool operator==(const Interference&, const Interference&) = default;
};

/// @param core_count  How many cores `busy` was summed over.
[[nodiscard]] Interference interference(const HostCounters& before, const HostCounters& after,
                                        int core_count);
/// Of what is computed elsewhere: what others use here counts as far as this process waited for a
/// core, which it did because of them for as long as they had one at most.
/// @param answering  What the programs of this machine used of it that answered this process: they
///                   are no others.
[[nodiscard]] Interference interference_elsewhere(const HostCounters& before,
                                                  const HostCounters& after, Nanos answering);

}  // namespace pirt
