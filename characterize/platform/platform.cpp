// Finding platforms: shipped ones are embedded in the binary, others are files.
#include "characterize/platform/platform.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <set>
#include <thread>
#include <utility>

#include "characterize/platform/platform_file.h"
#include "characterize/platform/shipped.h"
#include "platform_files.h"
#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/system/cores.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr std::array<std::string_view, 6> kRoles = {"cpu", "gpu", "dsp", "fpga", "cloud", "other"};

Platform read(const std::string& file, const std::string& text,
              const std::vector<YamlOverride>& overrides, std::span<const PhysicalCore> machine) {
  const auto document = parse_yaml(file, text, "units", overrides);
  Platform platform = read_platform(document, machine);
  platform.text = document.dump() + "\n";
  for (const YamlOverride& each : overrides) {
    platform.settings.push_back(each.path + "=" + each.value);
    const auto dot = each.path.find('.');
    const std::string key = each.path.substr(dot + 1);
    const auto unit = std::ranges::find(platform.units, each.path.substr(0, dot), &UnitModel::name);
    for (const auto& [begin, is_set] : {std::pair{"active_w", &UnitModel::active_set},
                                        {"energy", &UnitModel::energy_set},
                                        {"idle_w", &UnitModel::idle_set},
                                        {"held_w", &UnitModel::held_set}}) {
      if (!key.starts_with(begin)) continue;
      platform.watts_set = true;
      if (unit != platform.units.end()) (*unit).*is_set = true;
    }
  }
  return platform;
}

}  // namespace

std::string_view to_string(Role role) { return kRoles[static_cast<std::size_t>(role)]; }

std::optional<Role> role_from_string(std::string_view text) {
  const auto found = std::ranges::find(kRoles, text);
  if (found == kRoles.end()) return std::nullopt;
  return static_cast<Role>(found - kRoles.begin());
}

std::vector<std::string> role_names() { return {kRoles.begin(), kRoles.end()}; }

std::optional<std::size_t> Contexts::program_of(const std::string& workload) const {
  std::size_t position = 0;
  for (const auto& [name, workloads] : programs) {
    if (std::ranges::find(workloads, workload) != workloads.end()) return position;
    ++position;
  }
  return std::nullopt;
}

const UnitModel* Platform::find_unit(std::string_view unit) const {
  const auto it = std::ranges::find(units, unit, &UnitModel::name);
  return it == units.end() ? nullptr : &*it;
}

const UnitModel& Platform::unit(std::string_view name_of_unit) const {
  if (const auto* found = find_unit(name_of_unit)) return *found;
  throw_bad_input("platform " + name + " has no unit '" + std::string(name_of_unit) + "'" +
                  suggestion(name_of_unit, unit_names()));
}

std::vector<const UnitModel*> Platform::neighbours(const UnitModel& unit) const {
  std::vector<const UnitModel*> others;
  for (const UnitModel& other : units) {
    const bool shares = !unit.memory.empty() && other.memory == unit.memory;
    if (shares && other.name != unit.name) others.push_back(&other);
  }
  return others;
}

bool Platform::states_power(const UnitModel& unit) const {
  const double figures = unit.active_w + unit.op_pj + unit.byte_pj + unit.call_j;
  return figures > 0 || !unit.link.empty() ||
         std::ranges::any_of(workloads, [&unit](const auto& entry) {
           return entry.second.call_j.contains(unit.name);
         });
}

UnitModel on_device(UnitModel unit, bool device_is_cpu) {
  const bool fitted = unit.energy_provenance == Provenance::kFitted;
  if (!unit.watts_of_host_cores || device_is_cpu || fitted) return unit;
  if (!unit.active_set) unit.active_w = 0;
  if (!unit.energy_set) unit.op_pj = unit.byte_pj = unit.call_j = 0;
  if (!unit.idle_set) unit.idle_w = 0;
  if (!unit.held_set) unit.held_w = 0;
  return unit;
}

std::vector<std::string> Platform::unit_names() const {
  std::vector<std::string> names;
  for (const auto& unit : units) names.push_back(unit.name);
  return names;
}

Platform load_platform(const std::string& name, const std::vector<YamlOverride>& overrides) {
  const auto [file, text] = read_named("platform", name, platform_files::files());
  Platform platform = read(file, text, overrides, physical_cores(usable_cores()));
  platform.argument = name;
  return platform;
}

std::string platform_text(const Platform& platform, const std::vector<YamlOverride>& overrides) {
  return read(platform.name, platform.text, overrides, physical_cores(usable_cores())).text;
}

Platform parse_platform(const std::string& file, const std::string& text,
                        const std::vector<YamlOverride>& overrides, int host_cores) {
  std::vector<PhysicalCore> cores;
  for (int core = 0; core < std::max(1, host_cores); ++core) cores.push_back({.threads = {core}});
  return read(file, text, overrides, cores);
}

std::vector<std::string> shipped_platforms() { return names_of(platform_files::files()); }

std::string platform_hash(const Platform& platform) {
  return fmt::format("{:016x}", Hash64().add(platform.text).value());
}

std::vector<int> usable_cores() {
  // A robot's thread may be bound to a core of its own: that is no limit of ours.
  std::set<int> found;
  for (const pid_t thread : {0, ::getpid()}) {
    const auto cores = cores_of_thread(thread);
    found.insert(cores.begin(), cores.end());
  }
  std::vector<int> cores(found.begin(), found.end());
  if (cores.empty()) {
    cores.resize(std::max(1U, std::thread::hardware_concurrency()));
    std::iota(cores.begin(), cores.end(), 0);
  }
  return cores;
}

std::vector<int> cores_or_usable(const std::vector<int>& cores) {
  return cores.empty() ? usable_cores() : cores;
}

YamlOverride parse_override(const std::string& text) {
  const auto equals = text.find('=');
  const std::string path = text.substr(0, equals);
  const auto keys = split(path, '.');
  const bool complete = equals != std::string::npos && equals + 1 < text.size() &&
                        keys.size() >= 2 &&
                        std::ranges::none_of(keys, [](const auto& key) { return key.empty(); });
  if (!complete) {
    throw_bad_input("cannot read the setting '" + text +
                    "'; it is unit.key=value, e.g. cpu.active_w=15");
  }
  return {.path = path, .value = text.substr(equals + 1)};
}

std::vector<YamlOverride> parse_overrides(const std::vector<std::string>& texts) {
  std::vector<YamlOverride> overrides;
  for (const auto& text : texts) overrides.push_back(parse_override(text));
  return overrides;
}

}  // namespace pirt
