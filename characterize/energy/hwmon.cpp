// hwmon: the rails of INA3221 chips (Jetson boards), and sensors that give power or energy.
//
// Sources: Documentation/hwmon/ina3221.rst, Documentation/hwmon/sysfs-interface.rst. An INA3221 has
// three channels: inK_input is a bus voltage in millivolts, currK_input a current in milliamperes,
// K = 1..3. in4..6 are shunt voltages in microvolts, in7 and curr4 sums: none of them is a channel.
// powerN_input and powerN_average are in microwatts, energyN_input in microjoules.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <set>

#include "characterize/energy/meter.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

// Where a chip does not say how often it converts. Shorter than the chips' usual averages, so that
// a reading is at worst taken twice.
constexpr Nanos kUsualPeriod = std::chrono::milliseconds(50);
// An INA3221 read takes two transfers of about 0.3 ms on a 400 kHz bus: reading more often would
// disturb what is measured.
constexpr Nanos kShortestPeriod = std::chrono::milliseconds(5);
constexpr Nanos kLongestPeriod = std::chrono::seconds(10);
// The rails that everything else on a Jetson board is fed from, by the device trees of their
// kernels.
constexpr std::array kInputRails = {"VDD_IN", "POM_5V_IN"};
constexpr std::array kGpuDrivers = {"amdgpu", "radeon", "nouveau", "i915", "xe"};

class Ina3221Channel : public Meter {
 public:
  Ina3221Channel(MeterInfo info, fs::path voltage, fs::path current)
      : Meter(std::move(info)), voltage_(std::move(voltage)), current_(std::move(current)) {}
  [[nodiscard]] Attribute<std::int64_t> read() const override {
    auto voltage_mv = read_integer(voltage_);
    if (!voltage_mv.value) return voltage_mv;
    auto current_ma = read_integer(current_);
    if (!current_ma.value) return current_ma;
    return {*voltage_mv.value * *current_ma.value, "", 0};  // mV * mA = uW
  }

 private:
  fs::path voltage_, current_;
};

class HwmonSensor : public Meter {
 public:
  HwmonSensor(MeterInfo info, fs::path file) : Meter(std::move(info)), file_(std::move(file)) {}
  [[nodiscard]] Attribute<std::int64_t> read() const override { return read_integer(file_); }

 private:
  fs::path file_;
};

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

Nanos period_from(const fs::path& interval_ms) {
  const auto value = read_integer(interval_ms).value;
  if (!value || *value <= 0) return kUsualPeriod;
  return std::clamp<Nanos>(std::chrono::milliseconds(std::min<std::int64_t>(*value, 100'000)),
                           kShortestPeriod, kLongestPeriod);
}

/// The I2C address "1-0040" of a chip at .../1-0040/hwmon/hwmon3, otherwise "hwmon3".
std::string chip_name(const fs::path& device) {
  const auto above = device.parent_path();
  const std::string chip = above.parent_path().filename().string();
  const bool on_a_bus = above.filename() == "hwmon" && chip.find('-') != std::string::npos;
  return on_a_bus ? chip : device.filename().string();
}

void add_rail(const std::string& label, const std::string& unlabelled, const fs::path& voltage,
              const fs::path& current, Nanos period, MeterDiscovery& found) {
  MeterInfo info;
  info.driver = "ina3221";
  info.name = label.empty() ? unlabelled : label;
  info.covers = label.empty() ? "a rail without a label" : "rail " + label;
  if (std::ranges::find(kInputRails, label) != kInputRails.end()) {
    info.domain = MeterDomain::kBoard;
    info.covers = "board input";
  }
  info.period = period;
  info.path = current.string();
  found.meters.push_back(std::make_unique<Ina3221Channel>(std::move(info), voltage, current));
}

/// Kernels 4.4 and 4.9 of JetPack 3 and 4, the last for TX1, TX2 and Nano, show the chip by a
/// driver of NVIDIA's as channels 0..2 of an iio device, in mV and mA as well.
/// @source nvidia/drivers/staging/iio/meter/ina3221.c of L4T.
void add_iio_rails(const fs::path& sys, MeterDiscovery& found) {
  for (const auto& chip : folder_entries(sys / "bus" / "i2c" / "drivers" / "ina3221x")) {
    for (const auto& device : folder_entries(chip)) {
      if (!device.filename().string().starts_with("iio:device")) continue;
      for (int channel = 0; channel < 3; ++channel) {
        const auto voltage = device / fmt::format("in_voltage{}_input", channel);
        const auto current = device / fmt::format("in_current{}_input", channel);
        const auto label = text_or_empty(device / fmt::format("rail_name_{}", channel));
        if (label == "NC" || !is_there(voltage) || !is_there(current)) continue;
        const auto unlabelled = fmt::format("{}:{}", chip.filename().string(), channel);
        add_rail(label, unlabelled, voltage, current, kUsualPeriod, found);
      }
    }
  }
}

void add_channel(const fs::path& device, int channel, MeterDiscovery& found) {
  const auto attribute = [&](const char* pattern) {
    return device / fmt::format(fmt::runtime(pattern), channel);
  };
  const auto voltage = attribute("in{}_input");
  const auto current = attribute("curr{}_input");
  if (!is_there(voltage) || !is_there(current)) return;
  const std::string label = text_or_empty(attribute("in{}_label"));
  const std::string where = fmt::format("ina3221 {} channel {}", chip_name(device), channel);
  if (label == "NC") {
    found.missing.push_back(where + ": not connected (its label is NC)");
    return;
  }
  if (read_integer(attribute("in{}_enable")).value == 0) {
    found.missing.push_back(fmt::format("{}{}: switched off; on with: echo 1 > {}", where,
                                        label.empty() ? "" : " (" + label + ")",
                                        attribute("in{}_enable").string()));
    return;
  }
  add_rail(label, fmt::format("{}:{}", chip_name(device), channel), voltage, current,
           period_from(device / "update_interval"), found);
}

/// Every other rail of the board is fed from its input rail, whichever chip it is on.
void put_rails_under_input(MeterDiscovery& found) {
  const auto is_input = [](const auto& meter) {
    return meter->info().driver == "ina3221" && meter->info().domain == MeterDomain::kBoard;
  };
  const auto input = std::ranges::find_if(found.meters, is_input);
  if (input == found.meters.end()) return;
  for (auto& meter : found.meters) {
    if (meter->info().driver != "ina3221" || meter == *input) continue;
    meter->mutable_info().under = (*input)->info().name;
  }
}

/// Whether the GPU is on one chip with processors, whose power its sensor has as well.
/// @source Documentation/gpu/amdgpu/thermal.rst: in1, of the northbridge, is there on APUs alone,
/// and powerN of APUs includes the CPU. Older ones name it slowPPT and fastPPT (amdgpu_pm.c).
bool is_apu(const fs::path& device, const std::string& chip, const std::string& label) {
  return chip == "amdgpu" && (text_or_empty(device / "in1_label") == "vddnb" ||
                              label == "slowPPT" || label == "fastPPT");
}

MeterInfo sensor_info(const fs::path& device, const std::string& chip, const std::string& label) {
  MeterInfo info;
  info.driver = "hwmon";
  info.name = chip + "/" + label;
  info.covers = "sensor " + label + " of " + chip;
  if (is_apu(device, chip, label)) {
    info.domain = MeterDomain::kPackage;
    info.covers = "package";
  } else if (std::ranges::find(kGpuDrivers, chip) != kGpuDrivers.end()) {
    info.domain = MeterDomain::kGpu;
    info.covers = kCoversGpu;
  } else if (label.starts_with("Esocket")) {  // Documentation/hwmon/amd_energy.rst
    info.domain = MeterDomain::kPackage;
    info.covers = "package";
  } else if (chip == "power_meter") {  // Documentation/hwmon/acpi_power_meter.rst
    info.domain = MeterDomain::kBoard;
    info.covers = "board input";
  }
  return info;
}

/// The N of all powerN_ and energyN_ of a device: as many as it has, a socket's behind its cores'.
std::set<int> sensors_of(const fs::path& device) {
  std::set<int> numbers;
  for (const auto& entry : folder_entries(device)) {
    const std::string file = entry.filename().string();
    for (const std::string_view kind : {"power", "energy"}) {
      if (!file.starts_with(kind)) continue;
      const int number = std::atoi(file.c_str() + kind.size());
      if (number > 0) numbers.insert(number);
    }
  }
  return numbers;
}

void add_sensors(const fs::path& device, const std::string& chip, MeterDiscovery& found) {
  for (const int n : sensors_of(device)) {
    const auto attribute = [&](std::string_view kind, std::string_view what) {
      return device / fmt::format("{}{}_{}", kind, n, what);
    };
    const auto add = [&](std::string_view kind, MeterKind meter_kind, const fs::path& file) {
      const std::string label = text_or_empty(attribute(kind, "label"));
      MeterInfo info =
          sensor_info(device, chip, label.empty() ? fmt::format("{}{}", kind, n) : label);
      info.kind = meter_kind;
      info.path = file.string();
      if (meter_kind == MeterKind::kPower) {
        const auto averaged = attribute(kind, "average_interval");
        info.period =
            period_from(file.filename().string().ends_with("_average") && is_there(averaged)
                            ? averaged
                            : device / "update_interval");
      }
      found.meters.push_back(std::make_unique<HwmonSensor>(std::move(info), file));
    };
    const auto input = attribute("power", "input");
    const auto average = attribute("power", "average");
    if (is_there(input) || is_there(average)) {
      add("power", MeterKind::kPower, is_there(input) ? input : average);
    }
    if (const auto energy = attribute("energy", "input"); is_there(energy)) {
      add("energy", MeterKind::kCounter, energy);
    }
  }
}

/// hwmon devices of the INA3221 driver first, then the whole class; each once, since the class
/// holds links to the same folders.
std::vector<fs::path> hwmon_devices(const fs::path& sys) {
  std::vector<fs::path> candidates;
  for (const auto& chip : folder_entries(sys / "bus" / "i2c" / "drivers" / "ina3221")) {
    for (const auto& device : folder_entries(chip / "hwmon")) candidates.push_back(device);
  }
  for (const auto& device : folder_entries(sys / "class" / "hwmon")) candidates.push_back(device);
  std::vector<fs::path> devices;
  std::set<fs::path> seen;
  for (const auto& path : candidates) {
    std::error_code error;
    const auto canonical = fs::canonical(path, error);
    if (!error && seen.insert(canonical).second) devices.push_back(canonical);
  }
  return devices;
}

}  // namespace

void find_hwmon(const std::filesystem::path& sys, MeterDiscovery& found) {
  const auto before = found.meters.size();
  const auto devices = hwmon_devices(sys);
  for (const auto& device : devices) {
    const std::string chip = text_or_empty(device / "name");
    if (chip == "ina3221") {
      for (int channel = 1; channel <= 3; ++channel) add_channel(device, channel, found);
    } else if (!chip.empty()) {
      add_sensors(device, chip, found);
    }
  }
  add_iio_rails(sys, found);
  put_rails_under_input(found);
  if (found.meters.size() == before) {
    found.missing.push_back(
        fmt::format("hwmon: none of the {} devices in {} has a power or energy sensor",
                    devices.size(), (sys / "class" / "hwmon").string()));
  }
}

}  // namespace pirt
