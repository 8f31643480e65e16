#include "workloads/base/system/affinity.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <set>

#include "workloads/base/error.h"

namespace pirt {
namespace {

constexpr std::size_t kMostCores = 65'536;

/// False if one of them is out of range, or the kernel refuses.
bool set_cores(std::span<const int> cores) {
  std::vector<cpu_set_t> mask(kMostCores / CPU_SETSIZE);
  const std::size_t size_bytes = mask.size() * sizeof(cpu_set_t);
  for (const int core : cores) {
    if (core < 0 || static_cast<std::size_t>(core) >= kMostCores) return false;
    CPU_SET_S(static_cast<std::size_t>(core), size_bytes, mask.data());
  }
  return ::sched_setaffinity(0, size_bytes, mask.data()) == 0;
}

}  // namespace

std::vector<int> cores_of_thread(pid_t thread, int (*ask)(pid_t, std::size_t, cpu_set_t*)) {
  std::vector<int> cores;
  // The kernel refuses a mask that has no room for all cores of the machine.
  for (std::size_t count = CPU_SETSIZE; cores.empty() && count <= kMostCores; count *= 4) {
    std::vector<cpu_set_t> mask(count / CPU_SETSIZE);
    const std::size_t size_bytes = mask.size() * sizeof(cpu_set_t);
    if (ask(thread, size_bytes, mask.data()) != 0) continue;
    for (std::size_t core = 0; core < count; ++core) {
      if (CPU_ISSET_S(core, size_bytes, mask.data())) cores.push_back(static_cast<int>(core));
    }
  }
  return cores;
}

std::vector<int> current_cores() {
  auto cores = cores_of_thread(0);
  if (cores.empty()) {
    throw_environment(std::string("cannot read the thread's affinity: ") + std::strerror(errno));
  }
  return cores;
}

int bind_to_cores(std::span<const int> cores, const std::string& unit) {
  const auto before = current_cores();
  if (cores.empty()) return static_cast<int>(before.size());
  // The kernel drops cores that do not exist or that this process may not use, so what it took has
  // to be compared.
  if (set_cores(cores)) {
    const std::set<int> wanted(cores.begin(), cores.end());
    if (std::ranges::equal(current_cores(), wanted)) return static_cast<int>(wanted.size());
    set_cores(before);
  }
  throw_environment(fmt::format(
      "unit '{}' asks for the cores {}, which are not all there for this process (it runs on {}); "
      "correct `cores:` in the platform file",
      unit, fmt::join(cores, ","), fmt::join(before, ",")));
}

}  // namespace pirt
