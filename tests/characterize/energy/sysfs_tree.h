// A generated sysfs in a temporary folder, with the files that the kernel's documentation names.
#pragma once

#include <filesystem>
#include <string>

#include "tests/characterize/support.h"

namespace pirt::test {

class SysfsTree {
 public:
  [[nodiscard]] std::filesystem::path root() const { return folder_.path(); }

  std::filesystem::path write(const std::string& path, const std::string& text) const {
    const auto file = root() / path;
    std::filesystem::create_directories(file.parent_path());
    write_bytes(file, text + "\n");
    return file;
  }
  void remove(const std::string& path) const { std::filesystem::remove_all(root() / path); }

  /// Reading address 0 of a process' memory is the one read that every kernel answers with EIO.
  void fail_with_eio(const std::string& path) const {
    remove(path);
    std::filesystem::create_symlink("/proc/self/mem", root() / path);
  }

  /// @param zone  "intel-rapl:0", "intel-rapl:0:1"
  void add_rapl(const std::string& zone, const std::string& name, std::int64_t energy_uj,
                std::int64_t range_uj = 262'143'328'850) const {
    const std::string folder = "class/powercap/" + zone + "/";
    write(folder + "name", name);
    write(folder + "energy_uj", std::to_string(energy_uj));
    write(folder + "max_energy_range_uj", std::to_string(range_uj));
  }

  /// One channel of an INA3221 at e.g. chip "1-0040", device "hwmon3"; no label file for an empty
  /// label. Shunt voltages stand beside it as on the board.
  void add_channel(const std::string& chip, const std::string& device, int channel,
                   const std::string& label, std::int64_t voltage_mv,
                   std::int64_t current_ma) const {
    const std::string folder = "bus/i2c/drivers/ina3221/" + chip + "/hwmon/" + device + "/";
    const std::string n = std::to_string(channel);
    write(folder + "name", "ina3221");
    if (!label.empty()) write(folder + "in" + n + "_label", label);
    write(folder + "in" + n + "_enable", "1");
    write(folder + "in" + n + "_input", std::to_string(voltage_mv));
    write(folder + "curr" + n + "_input", std::to_string(current_ma));
    write(folder + "in" + std::to_string(channel + 3) + "_input",
          std::to_string(current_ma * 5));  // uV over 5 milliohms
    write(folder + "in7_input", "12345");
    write(folder + "in7_label", "sum of shunt voltages");
    write(folder + "curr4_input", "6789");
  }

 private:
  TemporaryFolder folder_;
};

}  // namespace pirt::test
