#include "characterize/energy/meter.h"

#include <fmt/core.h>

#include <algorithm>
#include <cerrno>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// Sums are written with '+' and white space between names, so that names have neither.
std::string plain_name(std::string name) {
  std::ranges::replace_if(
      name, [](char c) { return c == '+' || c == ',' || c == ' ' || c == '\t'; }, '_');
  return name;
}

/// Labels need not be unique: two sensor chips may both have a VDD_5V.
void make_names_unique(MeterDiscovery& found) {
  std::vector<std::string> seen;
  for (auto& meter : found.meters) {
    MeterInfo& info = meter->mutable_info();
    std::string name = info.name = plain_name(info.name);
    for (int i = 2; std::ranges::find(seen, name) != seen.end(); ++i) {
      name = info.name + "#" + std::to_string(i);
    }
    seen.push_back(info.name = name);
  }
}

std::string problem_of(const Meter& meter) {
  const auto reading = meter.read();
  if (reading.value) return "";
  const bool denied = reading.code == EACCES || reading.code == EPERM;
  if (!denied) return reading.error;
  return reading.error + "; run as root, or allow it until the next boot: sudo chmod a+r " +
         meter.info().path +
         (meter.info().driver == "rapl" ? " (kernels since 5.10 keep RAPL to root: CVE-2020-8694)"
                                        : "");
}

bool is_under(const MeterDiscovery& found, const Meter& inner, const Meter& outer) {
  const Meter* meter = &inner;
  for (std::size_t steps = 0; meter != nullptr && steps < found.meters.size(); ++steps) {
    if (meter->info().under == outer.info().name) return true;
    meter = found.find(meter->info().under);
  }
  return false;
}

}  // namespace

const Meter* MeterDiscovery::find(std::string_view name) const {
  const auto it = std::ranges::find(
      meters, name, [](const auto& meter) -> std::string_view { return meter->info().name; });
  return it == meters.end() ? nullptr : it->get();
}

std::vector<std::string> MeterDiscovery::names() const {
  std::vector<std::string> names;
  for (const auto& meter : meters) names.push_back(meter->info().name);
  return names;
}

MeterDiscovery discover_meters(const std::filesystem::path& sys, bool device_open) {
  MeterDiscovery found;
  find_rapl(sys, found);
  find_hwmon(sys, found);
  find_nvml(device_open, found);
  find_power_supplies(sys, found);
  make_names_unique(found);
  for (auto& meter : found.meters) meter->mutable_info().problem = problem_of(*meter);
  return found;
}

std::vector<const Meter*> find_meters(const MeterDiscovery& found, const std::string& sum) {
  std::vector<const Meter*> meters;
  for (const std::string& part : split(sum, '+')) {
    const std::string name = trimmed(part);
    const Meter* meter = found.find(name);
    if (meter == nullptr) {
      throw_bad_input("this machine has no meter '" + name + "'" + suggestion(name, found.names()) +
                      "; see: pirt list meters");
    }
    for (const Meter* other : meters) {
      if (other == meter) {
        throw_bad_input(fmt::format("meter '{}' is named twice in '{}'", name, sum));
      }
      const bool inner = is_under(found, *meter, *other);
      if (inner || is_under(found, *other, *meter)) {
        const auto& contained = inner ? meter->info().name : other->info().name;
        const auto& container = inner ? other->info().name : meter->info().name;
        throw_bad_input(
            fmt::format("meter '{}' cannot be added to '{}', which contains it; name one of them",
                        contained, container));
      }
    }
    meters.push_back(meter);
  }
  return meters;
}

}  // namespace pirt
