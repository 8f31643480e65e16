#include "workloads/base/system/affinity.h"

#include <fmt/format.h>
#include <sched.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include "workloads/base/error.h"

namespace pirt {
namespace {

cpu_set_t current_affinity() {
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof set, &set) != 0) {
    throw_environment(std::string("cannot read the thread's affinity: ") + std::strerror(errno));
  }
  return set;
}

std::vector<int> members(const cpu_set_t& set) {
  std::vector<int> cores;
  for (int core = 0; core < CPU_SETSIZE; ++core) {
    if (CPU_ISSET(static_cast<std::size_t>(core), &set)) cores.push_back(core);
  }
  return cores;
}

}  // namespace

std::vector<int> current_cores() { return members(current_affinity()); }

int bind_to_cores(std::span<const int> cores, const std::string& unit) {
  const cpu_set_t before = current_affinity();
  if (cores.empty()) return CPU_COUNT(&before);
  cpu_set_t wanted;
  CPU_ZERO(&wanted);
  bool possible = true;
  for (const int core : cores) {
    possible = possible && core >= 0 && core < CPU_SETSIZE;
    if (possible) CPU_SET(static_cast<std::size_t>(core), &wanted);
  }
  // The kernel drops cores that do not exist or that this process may not use, so what it took has
  // to be compared.
  if (possible && sched_setaffinity(0, sizeof wanted, &wanted) == 0) {
    const cpu_set_t taken = current_affinity();
    if (CPU_EQUAL(&taken, &wanted)) return CPU_COUNT(&wanted);
    sched_setaffinity(0, sizeof before, &before);
  }
  throw_environment(fmt::format(
      "unit '{}' asks for the cores {}, which are not all there for this process (it runs on {}); "
      "correct `cores:` in the platform file",
      unit, fmt::join(cores, ","), fmt::join(members(before), ",")));
}

}  // namespace pirt
