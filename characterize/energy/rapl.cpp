// RAPL: energy counters of packages and their parts, through the kernel's powercap class.
//
// Source: Documentation/power/powercap/powercap.rst, ABI/testing/sysfs-class-powercap. energy_uj is
// in microjoules and starts again at 0 behind max_energy_range_uj. Zones are told apart by `name`,
// since their numbers differ from machine to machine.
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <utility>

#include "characterize/energy/meter.h"

namespace pirt {
namespace {

class RaplZone : public Meter {
 public:
  RaplZone(MeterInfo info, std::filesystem::path file)
      : Meter(std::move(info)), file_(std::move(file)) {}
  [[nodiscard]] Attribute<std::int64_t> read() const override { return read_integer(file_); }

 private:
  std::filesystem::path file_;
};

/// "intel-rapl:0:1" -> "intel-rapl:0"; "" for a zone that stands by itself.
std::string parent_folder(const std::string& folder) {
  const auto last = folder.rfind(':');
  const std::string parent = folder.substr(0, last);
  return parent.find(':') == std::string::npos ? "" : parent;
}

std::string what_it_covers(const std::string& zone) {
  if (zone.starts_with("package")) return "package";
  if (zone == "core") return "cores";
  if (zone == "psys") return "platform";
  return zone;  // "dram", "uncore"
}

/// Whether a zone counts what @p meter counts: both are read while this thread computes. Where
/// neither moves, or one may not be read, their name decides.
bool counts_the_same(const Meter& meter, const std::filesystem::path& file) {
  constexpr Nanos kWatched = std::chrono::milliseconds(20);  // twenty updates
  const auto used = [&](const auto& before) {
    const auto a = meter.read().value, b = read_integer(file).value;
    return std::pair(a.value_or(0) - before.first, b.value_or(0) - before.second);
  };
  const auto begin = used(std::pair<std::int64_t, std::int64_t>(0, 0));
  const MachineClock clock;
  const Nanos end = clock.now() + kWatched;
  while (clock.now() < end) continue;
  const auto [a, b] = used(begin);
  return begin.first == 0 || begin.second == 0 || (a == 0 && b == 0) || (a < 2 * b && b < 2 * a);
}

}  // namespace

void find_rapl(const std::filesystem::path& sys, MeterDiscovery& found) {
  const auto powercap = sys / "class" / "powercap";
  std::map<std::string, std::string> names;  // by folder
  // Through memory, the same counters may be seen once more.
  auto zones = folder_entries(powercap);
  const auto is_first = [](const std::filesystem::path& path) {
    return !path.filename().string().starts_with("intel-rapl-mmio");
  };
  std::stable_partition(zones.begin(), zones.end(), is_first);
  for (const auto& path : zones) {
    const std::string folder = path.filename().string();
    const std::string zone = text_or_empty(path / "name");
    if (folder.find(':') == std::string::npos || zone.empty()) continue;  // a control type
    const auto file = path / "energy_uj";
    auto parent = names.find(parent_folder(folder));
    if (parent == names.end() && !is_first(path)) {
      parent = names.find(parent_folder("intel-rapl" + folder.substr(folder.find(':'))));
    }
    const std::string name = parent == names.end() ? zone : parent->second + "/" + zone;
    const Meter* const first = is_first(path) ? nullptr : found.find(name);
    if (first != nullptr && counts_the_same(*first, file)) {
      found.missing.push_back(fmt::format(
          "{}: the counter of zone '{}' through another register; counted once", folder, zone));
      continue;
    }
    std::error_code ignored;
    if (!std::filesystem::exists(file, ignored)) {
      found.missing.push_back(fmt::format("{}: zone '{}' counts no energy", folder, zone));
      continue;
    }
    MeterInfo info;
    info.name = name;
    info.driver = "rapl";
    info.kind = MeterKind::kCounter;
    info.domain = zone.starts_with("package") ? MeterDomain::kPackage : MeterDomain::kPart;
    info.covers = what_it_covers(zone);
    // A package's counter does not contain its memory's, though that is a zone below it.
    if (parent != names.end() && zone != "dram") info.under = parent->second;
    info.range_uj = read_integer(path / "max_energy_range_uj").value;
    info.path = file.string();
    names[folder] = info.name;
    found.meters.push_back(std::make_unique<RaplZone>(std::move(info), file));
  }
  if (found.find("psys") != nullptr) {
    for (auto& meter : found.meters) {
      MeterInfo& info = meter->mutable_info();
      if (info.under.empty() && info.name != "psys") info.under = "psys";
    }
  }
  if (found.meters.empty()) {
    found.missing.push_back(
        fmt::format("RAPL: no zones in {}; virtual machines and most Arm boards have none, "
                    "elsewhere: sudo modprobe intel_rapl_msr",
                    powercap.string()));
  }
}

}  // namespace pirt
