// RAPL: energy counters of packages and their parts, through the kernel's powercap class.
//
// Source: Documentation/power/powercap/powercap.rst, ABI/testing/sysfs-class-powercap. energy_uj is
// in microjoules and starts again at 0 behind max_energy_range_uj. Zones are told apart by `name`,
// since their numbers differ from machine to machine.
#include <fmt/core.h>

#include <map>

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

}  // namespace

void find_rapl(const std::filesystem::path& sys, MeterDiscovery& found) {
  const auto powercap = sys / "class" / "powercap";
  std::map<std::string, std::string> names;  // by folder
  for (const auto& path : folder_entries(powercap)) {
    const std::string folder = path.filename().string();
    const std::string zone = text_or_empty(path / "name");
    if (folder.find(':') == std::string::npos || zone.empty()) continue;  // a control type
    if (folder.starts_with("intel-rapl-mmio")) {
      found.missing.push_back(fmt::format(
          "{}: the counter of zone '{}' through another register; counted once", folder, zone));
      continue;
    }
    const auto file = path / "energy_uj";
    std::error_code ignored;
    if (!std::filesystem::exists(file, ignored)) {
      found.missing.push_back(fmt::format("{}: zone '{}' counts no energy", folder, zone));
      continue;
    }
    const auto parent = names.find(parent_folder(folder));
    MeterInfo info;
    info.name = parent == names.end() ? zone : parent->second + "/" + zone;
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
