#include "workloads/base/system/cores.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <fstream>
#include <functional>
#include <map>
#include <sstream>
#include <string>

namespace pirt {
namespace {

constexpr double kSameKind = 0.9;

std::string first_word(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::string word;
  in >> word;
  return word;
}

std::filesystem::path folder_of(const std::filesystem::path& root, int core) {
  return root / "sys/devices/system/cpu" / ("cpu" + std::to_string(core));
}

/// Of each core; empty where the kernel says nothing of one of them.
using Kinds = std::map<int, int>;

Kinds named_kinds(std::span<const int> usable, const std::filesystem::path& root) {
  Kinds kinds;
  int kind = 0;
  for (const auto* name : {"cpu_core", "cpu_atom", "cpu_lowpower"}) {
    for (const int core : parse_core_list(first_word(root / "sys/devices" / name / "cpus"))) {
      kinds.try_emplace(core, kind);
    }
    ++kind;
  }
  const bool all = std::ranges::all_of(usable, [&](int core) { return kinds.contains(core); });
  return all ? kinds : Kinds();
}

/// @param file  In a core's folder: a number that is larger the faster it is.
Kinds kinds_by(std::span<const int> usable, const std::filesystem::path& root,
               const std::string& file) {
  std::map<int, std::int64_t> speeds;
  for (const int core : usable) {
    std::ifstream in(folder_of(root, core) / file);
    std::int64_t speed = 0;
    if (!(in >> speed) || speed <= 0) return {};
    speeds[core] = speed;
  }
  std::set<std::int64_t, std::greater<>> falling;
  for (const auto& [core, speed] : speeds) falling.insert(speed);
  std::map<std::int64_t, int> kind_of;
  std::int64_t fastest = *falling.begin();
  int kind = 0;
  for (const std::int64_t speed : falling) {
    if (static_cast<double>(speed) < kSameKind * static_cast<double>(fastest)) {
      fastest = speed;
      ++kind;
    }
    kind_of[speed] = kind;
  }
  Kinds kinds;
  for (const auto& [core, speed] : speeds) kinds[core] = kind_of[speed];
  return kinds;
}

Kinds kinds_of(std::span<const int> usable, const std::filesystem::path& root) {
  Kinds kinds = named_kinds(usable, root);
  if (kinds.empty()) kinds = kinds_by(usable, root, "cpu_capacity");
  if (kinds.empty()) kinds = kinds_by(usable, root, "cpufreq/cpuinfo_max_freq");
  return kinds;
}

}  // namespace

std::vector<int> parse_core_list(std::string_view list) {
  constexpr int kMost = 65536;
  std::vector<int> cores;
  std::istringstream parts{std::string(list)};
  for (std::string part; std::getline(parts, part, ',');) {
    int first = 0;
    const char* const end = part.data() + part.size();
    const auto [at, failed] = std::from_chars(part.data(), end, first);
    if (failed != std::errc() || first < 0) continue;
    int last = first;
    if (at != end && *at == '-') std::from_chars(at + 1, end, last);
    for (int core = first; core <= std::min(last, kMost); ++core) cores.push_back(core);
  }
  return cores;
}

std::set<int> core_siblings(const std::filesystem::path& root, int core) {
  std::set<int> cores = {core};
  const auto list = first_word(folder_of(root, core) / "topology/thread_siblings_list");
  for (const int sibling : parse_core_list(list)) cores.insert(sibling);
  return cores;
}

std::vector<PhysicalCore> physical_cores(std::span<const int> usable,
                                         const std::filesystem::path& root) {
  const std::set<int> all(usable.begin(), usable.end());
  const Kinds kinds = kinds_of(usable, root);
  std::vector<PhysicalCore> cores;
  std::set<int> taken;
  for (const int first : all) {
    if (!taken.insert(first).second) continue;
    PhysicalCore core{.threads = {first}, .kind = 0};
    for (const int sibling : core_siblings(root, first)) {
      if (all.contains(sibling) && taken.insert(sibling).second) core.threads.push_back(sibling);
    }
    const auto kind = kinds.find(first);
    if (kind != kinds.end()) core.kind = kind->second;
    cores.push_back(std::move(core));
  }
  // Who may use cores of one kind only has the fastest.
  const auto fastest = std::ranges::min(cores, {}, &PhysicalCore::kind).kind;
  for (PhysicalCore& core : cores) core.kind -= fastest;
  return cores;
}

}  // namespace pirt
