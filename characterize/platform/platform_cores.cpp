#include "characterize/platform/platform_cores.h"

#include <algorithm>
#include <iterator>
#include <set>

#include "workloads/base/text/text.h"

namespace pirt {
namespace {

std::set<int> kinds_of(std::span<const PhysicalCore> cores) {
  std::set<int> kinds;
  for (const PhysicalCore& core : cores) kinds.insert(core.kind);
  return kinds;
}

/// Each thread of a single physical core by itself.
std::vector<PhysicalCore> divisible(std::span<const PhysicalCore> machine) {
  std::vector<PhysicalCore> cores(machine.begin(), machine.end());
  if (cores.size() != 1) return cores;
  std::vector<PhysicalCore> threads;
  for (const int thread : cores.front().threads) threads.push_back({.threads = {thread}});
  return threads;
}

std::vector<int> threads_of(std::span<const PhysicalCore> cores) {
  std::vector<int> threads;
  for (const PhysicalCore& core : cores)
    std::ranges::copy(core.threads, std::back_inserter(threads));
  std::ranges::sort(threads);
  return threads;
}

/// How many of the cores, the faster ones first, are in the first half.
std::size_t halve(std::vector<PhysicalCore>& cores) {
  std::ranges::stable_sort(cores, {}, &PhysicalCore::kind);
  if (kinds_of(cores).size() == 2) {
    const auto second = std::ranges::find_if(
        cores, [&](const PhysicalCore& core) { return core.kind != cores.front().kind; });
    return static_cast<std::size_t>(second - cores.begin());
  }
  return cores.size() - cores.size() / 2;
}

/// The physical cores that have some of these threads.
std::vector<PhysicalCore> cores_with(const std::vector<int>& threads,
                                     std::span<const PhysicalCore> machine) {
  std::vector<PhysicalCore> found;
  std::ranges::copy_if(machine, std::back_inserter(found), [&](const PhysicalCore& core) {
    return std::ranges::find_first_of(core.threads, threads) != core.threads.end();
  });
  return found;
}

std::string numbers(const std::vector<int>& cores) {
  std::vector<std::string> texts;
  for (const int core : cores) texts.push_back(std::to_string(core));
  return join(texts, ",");
}

void remark_on_kinds(const Platform& platform, std::span<const PhysicalCore> machine,
                     std::vector<std::string>& remarks) {
  std::set<int> kinds;
  bool mixed = false;
  std::vector<std::string> each;
  for (const UnitModel& unit : platform.units) {
    if (unit.cores.empty()) continue;
    const auto own = kinds_of(cores_with(unit.cores, machine));
    kinds.insert(own.begin(), own.end());
    if (own.size() > 1) {
      mixed = true;
      remarks.push_back("unit " + unit.name + " has cores of " + std::to_string(own.size()) +
                        " kinds (" + numbers(unit.cores) +
                        "): how long its calls take depends on which of them they run on; name "
                        "cores of one kind, e.g. --set " +
                        unit.name + ".cores=[0,1]");
    } else {
      each.push_back(unit.name + " " + (own == std::set{0} ? "fast" : "slow") + " ones (" +
                     numbers(unit.cores) + ")");
    }
  }
  if (mixed || kinds.size() < 2) return;
  remarks.push_back("this machine has cores of several kinds, and each unit has one: " +
                    join(each, ", ") + "; what tells the units apart is the cores, too");
}

void remark_on_threads(const Platform& platform, std::span<const PhysicalCore> machine,
                       std::vector<std::string>& remarks) {
  for (std::size_t a = 0; a < platform.units.size(); ++a) {
    for (std::size_t b = a + 1; b < platform.units.size(); ++b) {
      const UnitModel& one = platform.units[a];
      const UnitModel& other = platform.units[b];
      const bool same = std::ranges::find_first_of(one.cores, other.cores) != one.cores.end();
      if (same) continue;  // Noted in each row.
      for (const PhysicalCore& core : cores_with(one.cores, machine)) {
        if (std::ranges::find_first_of(core.threads, other.cores) == core.threads.end()) continue;
        remarks.push_back("units " + one.name + " and " + other.name +
                          " are threads of one physical core (" + numbers(core.threads) +
                          "): each is slower while the other computes");
        break;
      }
    }
  }
}

}  // namespace

const std::vector<std::string>& core_parts() {
  static const std::vector<std::string> parts = {"first_half", "second_half", "all_but_two",
                                                 "last_two", "all"};
  return parts;
}

std::vector<int> cores_of_part(std::string_view part, std::span<const PhysicalCore> machine) {
  std::vector<PhysicalCore> cores = divisible(machine);
  if (part == "all" || cores.size() < 2) return threads_of(cores);
  const bool halves = part.ends_with("_half") || cores.size() < 4;
  const std::size_t middle = halves ? halve(cores) : cores.size() - 2;
  const std::span all(cores);
  const bool first = part == "first_half" || part == "all_but_two";
  return threads_of(first ? all.first(middle) : all.subspan(middle));
}

std::vector<std::string> core_remarks(const Platform& platform,
                                      std::span<const PhysicalCore> machine) {
  std::vector<std::string> remarks;
  remark_on_threads(platform, machine, remarks);
  remark_on_kinds(platform, machine, remarks);
  return remarks;
}

}  // namespace pirt
