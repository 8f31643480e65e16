// Energy meters of a machine: RAPL counters, INA3221 rails and other hwmon sensors and batteries,
// as the kernel shows them in sysfs, and NVIDIA's boards. One interface; each driver is one file
// beside this one.
//
// A meter is only read here. What its readings say about a span of time is in window.h, what they
// say about a kernel's call in metered_calls.h.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/machine/system_files.h"
#include "workloads/base/time.h"

namespace pirt {

/// What a meter's reading is.
enum class MeterKind : std::uint8_t {
  kCounter,  ///< Microjoules since some moment; only differences mean something.
  kPower,    ///< Microwatts at the moment of reading.
};

/// What of the machine a meter covers, as far as choosing one for a unit depends on it.
enum class MeterDomain : std::uint8_t { kBoard, kPackage, kGpu, kBattery, kPart };

/// What meters of domain kGpu cover.
inline constexpr std::string_view kCoversGpu = "gpu";

struct MeterInfo {
  std::string name;    ///< Unique on the machine: "package-0", "package-0/dram", "VDD_IN", "BAT0".
  std::string driver;  ///< "rapl", "ina3221", "hwmon", "nvml", "power_supply".
  MeterKind kind = MeterKind::kPower;
  MeterDomain domain = MeterDomain::kPart;
  std::string covers;  ///< "package", "dram", "board input", "rail VDD_SOC", "gpu", "battery".
  std::string
      under;  ///< The meter whose reading contains this one's; empty = none. Never add both.
  std::optional<std::int64_t> range_uj;  ///< Counters: what to add where it wraps.
  bool steps = false;   ///< Counters: stands still for milliseconds between two values.
  std::string pci;      ///< The board that it measures, as pci_address has it; empty = not known.
  Nanos period{0};      ///< Power sensors: how often there is a new reading.
  std::string path;     ///< The file that is read (the first of them).
  std::string problem;  ///< Why it could not be read when it was found, with the remedy.
};

class Meter {
 public:
  explicit Meter(MeterInfo info) : info_(std::move(info)) {}
  virtual ~Meter() = default;
  Meter(const Meter&) = delete;
  Meter& operator=(const Meter&) = delete;

  /// Microjoules or microwatts, by info().kind. May be called by any one thread at a time.
  [[nodiscard]] virtual Attribute<std::int64_t> read() const = 0;

  [[nodiscard]] const MeterInfo& info() const { return info_; }
  /// Only while the machine's meters are being found.
  [[nodiscard]] MeterInfo& mutable_info() { return info_; }

 private:
  MeterInfo info_;
};

struct MeterDiscovery {
  std::vector<std::unique_ptr<Meter>> meters;  ///< Also those with a problem.
  std::vector<std::string> missing;            ///< What is not there or not known, and why.

  /// Null if there is none.
  [[nodiscard]] const Meter* find(std::string_view name) const;
  [[nodiscard]] std::vector<std::string> names() const;
};

/// All meters of a machine.
/// @param sys  Where sysfs is mounted; another folder in tests.
/// @param device_open  This process has a device open: it is no stranger on its board.
[[nodiscard]] MeterDiscovery discover_meters(const std::filesystem::path& sys = "/sys",
                                             bool device_open = false);

/// The meters whose sum "VDD_CPU + VDD_GPU" means; one name is a sum of one.
/// @throws Error{kBadInput}: no such meter (with the nearest names), one named twice, or one under
/// another, whose energy would count twice.
[[nodiscard]] std::vector<const Meter*> find_meters(const MeterDiscovery& found,
                                                    const std::string& sum);

// The drivers, for discover_meters.
void find_rapl(const std::filesystem::path& sys, MeterDiscovery& found);
void find_hwmon(const std::filesystem::path& sys, MeterDiscovery& found);
void find_nvml(bool device_open, MeterDiscovery& found);
void find_power_supplies(const std::filesystem::path& sys, MeterDiscovery& found);

}  // namespace pirt
