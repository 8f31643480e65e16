// Which of the host's logical cores are one physical core, and of which kind that is.
#pragma once

#include <filesystem>
#include <set>
#include <span>
#include <string_view>
#include <vector>

namespace pirt {

/// "0-3,8" as numbers; what is none is left out.
[[nodiscard]] std::vector<int> parse_core_list(std::string_view list);

/// The logical cores of the physical core that @p core is on; itself alone where the kernel does
/// not say.
/// @param root  "/", or the folder of a recorded machine.
/// @source Documentation/admin-guide/cputopology: thread_siblings_list, as "0-1,4".
[[nodiscard]] std::set<int> core_siblings(const std::filesystem::path& root, int core);

/// A physical core, as far as this program may use it.
struct PhysicalCore {
  std::vector<int> threads;  ///< Its logical cores, rising; at least one.
  int kind = 0;              ///< 0 = of the fastest kind that the machine has.
  friend bool operator==(const PhysicalCore&, const PhysicalCore&) = default;
};

/// In order of their first threads. What the kernel calls kinds (Intel's cpu_core and cpu_atom), or
/// else what differs by more than 10 % in its capacity (cpu_capacity), or else in its highest
/// clock: boards of one kind of core have some that clock a little higher. Where the kernel does
/// not say, all are of one kind.
/// @param usable  Logical cores that the program may use; at least one.
/// @param root    As for core_siblings.
/// @source Documentation/ABI/testing/sysfs-devices-system-cpu; perf's cpu_core/cpus, cpu_atom/cpus.
[[nodiscard]] std::vector<PhysicalCore> physical_cores(std::span<const int> usable,
                                                       const std::filesystem::path& root = "/");

}  // namespace pirt
