// Batteries: what the machine draws while it runs on one.
//
// Source: Documentation/ABI/testing/sysfs-class-power: power_now in microwatts, current_now in
// microamperes, voltage_now in microvolts. Some drivers give a discharge as a negative figure, so
// that only the size counts. While a battery is charging, or full on the mains, its figures say
// nothing about what the machine draws.
#include <fmt/core.h>

#include <cstdlib>

#include "characterize/energy/meter.h"

namespace pirt {
namespace {

// Fuel gauges and embedded controllers renew their figures every second or more rarely.
constexpr Nanos kGaugePeriod = std::chrono::seconds(1);

class Battery : public Meter {
 public:
  Battery(MeterInfo info, std::filesystem::path folder)
      : Meter(std::move(info)), folder_(std::move(folder)) {}

  [[nodiscard]] Attribute<std::int64_t> read() const override {
    const auto status = read_attribute(folder_ / "status");
    if (!status.value) return {std::nullopt, status.error, status.code};
    if (*status.value != "Discharging") {
      return {std::nullopt,
              fmt::format("battery {} is not discharging (its status is '{}'); unplug the charger",
                          info().name, *status.value),
              0};
    }
    const auto power_uw = read_integer(folder_ / "power_now");
    if (power_uw.value) return {std::abs(*power_uw.value), "", 0};
    auto current_ua = read_integer(folder_ / "current_now");
    if (!current_ua.value) return current_ua;
    auto voltage_uv = read_integer(folder_ / "voltage_now");
    if (!voltage_uv.value) return voltage_uv;
    const double power_pw = static_cast<double>(*current_ua.value) *
                            static_cast<double>(*voltage_uv.value);  // can exceed 63 bits
    return {static_cast<std::int64_t>(std::abs(power_pw) * 1e-6), "", 0};
  }

 private:
  std::filesystem::path folder_;
};

}  // namespace

void find_power_supplies(const std::filesystem::path& sys, MeterDiscovery& found) {
  const auto folder = sys / "class" / "power_supply";
  bool any = false;
  for (const auto& path : folder_entries(folder)) {
    const std::string name = path.filename().string();
    const std::string type = text_or_empty(path / "type");
    if (type != "Battery") {
      found.missing.push_back(fmt::format("power supply {}: no battery but '{}'", name, type));
      continue;
    }
    if (text_or_empty(path / "scope") == "Device") {
      found.missing.push_back(
          fmt::format("power supply {}: the battery of a peripheral, not of this machine", name));
      continue;
    }
    any = true;
    MeterInfo info;
    info.name = name;
    info.driver = "power_supply";
    info.domain = MeterDomain::kBattery;
    info.covers = "battery";
    info.period = kGaugePeriod;
    std::error_code ignored;
    const bool gives_power = std::filesystem::exists(path / "power_now", ignored);
    info.path = (path / (gives_power ? "power_now" : "current_now")).string();
    found.meters.push_back(std::make_unique<Battery>(std::move(info), path));
  }
  if (!any) found.missing.push_back(fmt::format("battery: none in {}", folder.string()));
}

}  // namespace pirt
