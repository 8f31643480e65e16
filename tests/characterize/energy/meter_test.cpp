#include "characterize/energy/meter.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/fsuid.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/characterize/energy/sysfs_tree.h"

namespace pirt {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

/// What reading the meter of that name gives now.
std::int64_t reading(const MeterDiscovery& found, const std::string& name) {
  const Meter* meter = found.find(name);
  if (meter == nullptr) {
    ADD_FAILURE() << "no meter " << name;
    return 0;
  }
  const auto result = meter->read();
  EXPECT_EQ(result.error, "");
  return result.value.value_or(-1);
}

/// File permissions count for this thread, also if it is root's.
class WithoutPrivileges {
 public:
  WithoutPrivileges() : before_(::setfsuid(::geteuid() == 0 ? 65534 : ::geteuid())) {}
  ~WithoutPrivileges() { ::setfsuid(static_cast<uid_t>(before_)); }
  WithoutPrivileges(const WithoutPrivileges&) = delete;
  WithoutPrivileges& operator=(const WithoutPrivileges&) = delete;

 private:
  int before_;
};

TEST(Meters, ThereAreNoneOnAnEmptyMachineAndItSaysWhy) {
  const test::SysfsTree tree;
  const auto found = discover_meters(tree.root());
  EXPECT_THAT(found.meters, IsEmpty());
  EXPECT_THAT(
      found.missing,
      ElementsAre(HasSubstr("RAPL: no zones"), HasSubstr("hwmon: none of the 0 devices"),
                  HasSubstr("NVML: not asked, PIRT_NVML is none"), HasSubstr("battery: none")));
}

TEST(Meters, RaplZonesAreToldApartByName) {
  const test::SysfsTree tree;
  // Numbered against the names, as some machines do.
  tree.add_rapl("intel-rapl:0", "package-1", 7'000'000);
  tree.add_rapl("intel-rapl:0:0", "dram", 300);
  tree.add_rapl("intel-rapl:1", "package-0", 5'000'000);
  tree.add_rapl("intel-rapl:1:0", "core", 100);
  tree.write("class/powercap/intel-rapl/enabled", "1");  // the control type: no zone
  const auto found = discover_meters(tree.root());
  EXPECT_THAT(found.names(),
              ElementsAre("package-1", "package-1/dram", "package-0", "package-0/core"));
  EXPECT_EQ(reading(found, "package-0"), 5'000'000);
  EXPECT_EQ(reading(found, "package-1/dram"), 300);
  const MeterInfo& package = found.find("package-0")->info();
  EXPECT_EQ(package.kind, MeterKind::kCounter);
  EXPECT_EQ(package.domain, MeterDomain::kPackage);
  EXPECT_EQ(package.covers, "package");
  EXPECT_EQ(package.range_uj, 262'143'328'850);
  EXPECT_EQ(package.problem, "");
  EXPECT_EQ(found.find("package-0/core")->info().covers, "cores");
}

TEST(Meters, ZonesWithoutACounterAndSecondRegistersAreNoMeters) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  tree.add_rapl("intel-rapl-mmio:0", "package-0", 1);
  tree.write("class/powercap/dtpm:0/name", "soc");
  tree.write("class/powercap/dtpm:0/power_uw", "1000");
  const auto found = discover_meters(tree.root());
  EXPECT_THAT(found.names(), ElementsAre("package-0"));
  EXPECT_THAT(found.missing, Contains(HasSubstr("'soc' counts no energy")));
  EXPECT_THAT(found.missing, Contains(HasSubstr("intel-rapl-mmio:0")));
}

TEST(Meters, AZoneThroughASecondRegisterIsAMeterWhereNothingElseCountsIt) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl-mmio:0", "package-0", 7);
  tree.add_rapl("intel-rapl-mmio:0:0", "dram", 3);
  const auto found = discover_meters(tree.root());
  EXPECT_THAT(found.names(), ElementsAre("package-0", "package-0/dram"));
  EXPECT_EQ(reading(found, "package-0"), 7);
  for (const auto& line : found.missing) EXPECT_THAT(line, Not(HasSubstr("counted once")));
  tree.add_rapl("intel-rapl:0", "package-0", 7);
  EXPECT_THAT(discover_meters(tree.root()).names(), ElementsAre("package-0", "package-0/dram"));
}

TEST(Meters, ASocketBehindItsCoresIsThePackage) {
  const test::SysfsTree tree;
  tree.write("class/hwmon/hwmon0/name", "amd_energy");
  for (int core = 1; core <= 32; ++core) {
    tree.write(fmt::format("class/hwmon/hwmon0/energy{}_label", core),
               fmt::format("Ecore{:03}", core - 1));
    tree.write(fmt::format("class/hwmon/hwmon0/energy{}_input", core), "1");
  }
  tree.write("class/hwmon/hwmon0/energy33_label", "Esocket0");
  tree.write("class/hwmon/hwmon0/energy33_input", "99");
  const auto found = discover_meters(tree.root());
  EXPECT_EQ(reading(found, "amd_energy/Esocket0"), 99);
  EXPECT_EQ(found.find("amd_energy/Esocket0")->info().domain, MeterDomain::kPackage);
}

TEST(Meters, RailsOfJetPack4AreThoseOfTheBoard) {
  const test::SysfsTree tree;
  const std::string device = "bus/i2c/drivers/ina3221x/1-0040/iio:device0/";
  int channel = 0;
  for (const auto& [rail, current] :
       {std::pair{"VDD_IN", "742"}, {"VDD_GPU", "120"}, {"NC", "0"}}) {
    tree.write(device + fmt::format("rail_name_{}", channel), rail);
    tree.write(device + fmt::format("in_voltage{}_input", channel), "5000");
    tree.write(device + fmt::format("in_current{}_input", channel++), current);
  }
  const auto found = discover_meters(tree.root());
  EXPECT_THAT(found.names(), ElementsAre("VDD_IN", "VDD_GPU"));
  EXPECT_EQ(reading(found, "VDD_IN"), 3'710'000);  // uW
  EXPECT_EQ(found.find("VDD_IN")->info().domain, MeterDomain::kBoard);
  EXPECT_EQ(found.find("VDD_GPU")->info().under, "VDD_IN");
}

TEST(Meters, APackageContainsItsCoresAndNotItsMemory) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  tree.add_rapl("intel-rapl:0:0", "core", 1);
  tree.add_rapl("intel-rapl:0:1", "dram", 1);
  const auto found = discover_meters(tree.root());
  EXPECT_EQ(find_meters(found, "package-0 + package-0/dram").size(), 2U);
  const auto refused = test::error_of(
      ErrorCode::kBadInput, [&] { return find_meters(found, "package-0+package-0/core"); });
  EXPECT_THAT(refused, HasSubstr("'package-0/core' cannot be added to 'package-0'"));
}

TEST(Meters, AreNamedByTheirNamesOnly) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  const auto found = discover_meters(tree.root());
  const auto refusal = [&](const std::string& sum) {
    return test::error_of(ErrorCode::kBadInput, [&] { return find_meters(found, sum); });
  };
  EXPECT_THAT(refusal("package-O"), HasSubstr("package-0"));  // the nearest one
  EXPECT_THAT(refusal("package-0 + package-0"), HasSubstr("twice"));
  EXPECT_THAT(refusal(""), HasSubstr("no meter ''"));
  EXPECT_THAT(refusal("package-0 +"), HasSubstr("no meter ''"));
}

/// A Jetson Orin Nano: three rails, of which VDD_IN feeds the others.
void make_jetson(const test::SysfsTree& tree) {
  tree.add_channel("1-0040", "hwmon1", 1, "VDD_IN", 5000, 1200);
  tree.add_channel("1-0040", "hwmon1", 2, "VDD_CPU_GPU_CV", 4990, 300);
  tree.add_channel("1-0040", "hwmon1", 3, "VDD_SOC", 4980, 200);
  tree.write("bus/i2c/drivers/ina3221/1-0040/hwmon/hwmon1/update_interval", "20");
}

TEST(Meters, Ina3221PowerIsBusVoltageTimesCurrent) {
  const test::SysfsTree tree;
  make_jetson(tree);
  const auto found = discover_meters(tree.root());
  // Channels 4 to 7 are shunt voltages and sums.
  EXPECT_THAT(found.names(), ElementsAre("VDD_IN", "VDD_CPU_GPU_CV", "VDD_SOC"));
  EXPECT_EQ(reading(found, "VDD_IN"), 6'000'000);  // 5.000 V * 1.200 A = 6 W
  EXPECT_EQ(reading(found, "VDD_SOC"), 4980 * 200);
  EXPECT_EQ(found.find("VDD_IN")->info().period, std::chrono::milliseconds(20));
  EXPECT_EQ(found.find("VDD_IN")->info().covers, "board input");
  EXPECT_EQ(found.find("VDD_SOC")->info().covers, "rail VDD_SOC");
}

TEST(Meters, RailsUnderTheInputRailAreNotAddedToIt) {
  const test::SysfsTree tree;
  make_jetson(tree);
  tree.add_channel("1-0041", "hwmon2", 1, "VDD_5V0_SYS", 5000, 10);  // another chip, the same board
  const auto found = discover_meters(tree.root());
  EXPECT_EQ(found.find("VDD_5V0_SYS")->info().under, "VDD_IN");
  for (const auto* sum : {"VDD_IN + VDD_SOC", "VDD_SOC + VDD_IN", "VDD_5V0_SYS+VDD_IN"}) {
    const auto refused =
        test::error_of(ErrorCode::kBadInput, [&] { return find_meters(found, sum); });
    EXPECT_THAT(refused, HasSubstr("cannot be added to 'VDD_IN', which contains it"));
  }
  EXPECT_EQ(find_meters(found, "VDD_SOC + VDD_CPU_GPU_CV").size(), 2U);
}

TEST(Meters, AChannelWithoutLabelIsNamedByItsPlace) {
  const test::SysfsTree tree;
  tree.add_channel("1-0040", "hwmon1", 1, "", 5000, 100);
  tree.add_channel("1-0040", "hwmon1", 2, "NC", 0, 0);
  tree.add_channel("1-0040", "hwmon1", 3, "VDD_GPU", 5000, 100);
  tree.write("bus/i2c/drivers/ina3221/1-0040/hwmon/hwmon1/in3_enable", "0");
  const auto found = discover_meters(tree.root());
  ASSERT_THAT(found.names(), ElementsAre("1-0040:1"));
  EXPECT_EQ(found.meters[0]->info().covers, "a rail without a label");
  EXPECT_EQ(found.meters[0]->info().domain, MeterDomain::kPart);
  EXPECT_THAT(found.missing, Contains(HasSubstr("channel 2: not connected")));
  EXPECT_THAT(found.missing, Contains(HasSubstr("channel 3 (VDD_GPU): switched off")));
}

TEST(Meters, EqualLabelsOfTwoChipsStayApart) {
  const test::SysfsTree tree;
  tree.add_channel("1-0040", "hwmon1", 1, "VDD 5V", 5000, 100);
  tree.add_channel("1-0041", "hwmon2", 1, "VDD 5V", 5000, 200);
  const auto found = discover_meters(tree.root());
  EXPECT_THAT(found.names(), ElementsAre("VDD_5V", "VDD_5V#2"));
  EXPECT_EQ(reading(found, "VDD_5V#2"), 1'000'000);
}

TEST(Meters, AChipIsFoundOnceThoughTheClassLinksToItAsWell) {
  const test::SysfsTree tree;
  make_jetson(tree);
  std::filesystem::create_directories(tree.root() / "class/hwmon");
  std::filesystem::create_directory_symlink(
      tree.root() / "bus/i2c/drivers/ina3221/1-0040/hwmon/hwmon1",
      tree.root() / "class/hwmon/hwmon1");
  EXPECT_EQ(discover_meters(tree.root()).meters.size(), 3U);
}

TEST(Meters, OtherHwmonSensorsGivePowerOrEnergy) {
  const test::SysfsTree tree;
  tree.write("class/hwmon/hwmon0/name", "amdgpu");
  tree.write("class/hwmon/hwmon0/power1_average", "45000000");
  tree.write("class/hwmon/hwmon0/power1_label", "PPT");
  tree.write("class/hwmon/hwmon1/name", "power_meter");
  tree.write("class/hwmon/hwmon1/power1_average", "90000000");
  tree.write("class/hwmon/hwmon1/power1_average_interval", "300");
  tree.write("class/hwmon/hwmon2/name", "amd_energy");
  tree.write("class/hwmon/hwmon2/energy1_input", "77");
  tree.write("class/hwmon/hwmon2/energy1_label", "Esocket0");
  tree.write("class/hwmon/hwmon3/name", "coretemp");
  tree.write("class/hwmon/hwmon3/temp1_input", "45000");
  const auto found = discover_meters(tree.root());
  ASSERT_THAT(found.names(),
              ElementsAre("amdgpu/PPT", "power_meter/power1", "amd_energy/Esocket0"));
  EXPECT_EQ(reading(found, "amdgpu/PPT"), 45'000'000);
  EXPECT_EQ(found.find("amdgpu/PPT")->info().domain, MeterDomain::kGpu);
  EXPECT_EQ(found.find("power_meter/power1")->info().domain, MeterDomain::kBoard);
  EXPECT_EQ(found.find("power_meter/power1")->info().period, std::chrono::milliseconds(300));
  EXPECT_EQ(found.find("amd_energy/Esocket0")->info().kind, MeterKind::kCounter);
  EXPECT_EQ(found.find("amd_energy/Esocket0")->info().range_uj, std::nullopt);
}

TEST(Meters, TheSensorOfAnApuHasItsProcessorsToo) {
  const test::SysfsTree tree;
  tree.write("class/hwmon/hwmon0/name", "amdgpu");
  tree.write("class/hwmon/hwmon0/power1_average", "15000000");
  tree.write("class/hwmon/hwmon0/power1_label", "PPT");
  tree.write("class/hwmon/hwmon0/in1_label", "vddnb");
  EXPECT_EQ(discover_meters(tree.root()).find("amdgpu/PPT")->info().domain, MeterDomain::kPackage);
  tree.remove("class/hwmon/hwmon0/in1_label");
  EXPECT_EQ(discover_meters(tree.root()).find("amdgpu/PPT")->info().domain, MeterDomain::kGpu);
}

void add_battery(const test::SysfsTree& tree, const std::string& status) {
  tree.write("class/power_supply/BAT0/type", "Battery");
  tree.write("class/power_supply/BAT0/status", status);
}

TEST(Meters, ABatteryGivesPowerOrCurrentTimesVoltage) {
  const test::SysfsTree tree;
  add_battery(tree, "Discharging");
  tree.write("class/power_supply/BAT0/power_now", "-8500000");  // some drivers count charge
  EXPECT_EQ(reading(discover_meters(tree.root()), "BAT0"), 8'500'000);
  tree.remove("class/power_supply/BAT0/power_now");
  tree.write("class/power_supply/BAT0/current_now", "-700000");   // 0.7 A
  tree.write("class/power_supply/BAT0/voltage_now", "11500000");  // 11.5 V
  EXPECT_EQ(reading(discover_meters(tree.root()), "BAT0"), 8'050'000);
}

TEST(Meters, ABatteryCountsWhileItDischargesOnly) {
  const test::SysfsTree tree;
  tree.write("class/power_supply/BAT0/power_now", "8500000");
  for (const auto* status : {"Charging", "Full", "Not charging", "Unknown"}) {
    add_battery(tree, status);
    const auto found = discover_meters(tree.root());
    ASSERT_EQ(found.meters.size(), 1U);
    EXPECT_EQ(found.meters[0]->read().value, std::nullopt) << status;
    EXPECT_THAT(found.meters[0]->info().problem, HasSubstr("unplug the charger")) << status;
  }
}

TEST(Meters, MainsAndPeripheralsAreNoMeters) {
  const test::SysfsTree tree;
  tree.write("class/power_supply/AC/type", "Mains");
  tree.write("class/power_supply/hidpp_battery_0/type", "Battery");
  tree.write("class/power_supply/hidpp_battery_0/scope", "Device");
  const auto found = discover_meters(tree.root());
  EXPECT_THAT(found.meters, IsEmpty());
  EXPECT_THAT(found.missing, Contains(HasSubstr("AC: no battery but 'Mains'")));
  EXPECT_THAT(found.missing, Contains(HasSubstr("hidpp_battery_0: the battery of a peripheral")));
}

TEST(Meters, AMissingPermissionComesWithItsRemedy) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  const auto file = tree.root() / "class/powercap/intel-rapl:0/energy_uj";
  ::chmod(tree.root().c_str(), 0755);
  ::chmod(file.c_str(), 0000);
  const WithoutPrivileges unprivileged;
  const auto found = discover_meters(tree.root());
  ASSERT_EQ(found.meters.size(), 1U);
  EXPECT_THAT(found.meters[0]->info().problem, HasSubstr("Permission denied"));
  EXPECT_THAT(found.meters[0]->info().problem, HasSubstr("sudo chmod a+r " + file.string()));
}

TEST(Meters, AFailingReadIsDataAndNeverWaits) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  const std::string file = "class/powercap/intel-rapl:0/energy_uj";
  const auto found = discover_meters(tree.root());
  const auto error = [&] { return found.find("package-0")->read().error; };

  tree.fail_with_eio(file);
  EXPECT_THAT(error(), HasSubstr("Input/output error"));
  tree.remove(file);
  EXPECT_THAT(error(), HasSubstr("No such file"));
  std::filesystem::create_directory(tree.root() / file);
  EXPECT_THAT(error(), HasSubstr("Is a directory"));
  tree.remove(file);
  ASSERT_EQ(::mkfifo((tree.root() / file).c_str(), 0600), 0);
  EXPECT_THAT(error(), HasSubstr("no number: ''"));
  tree.remove(file);
  tree.write(file, "12 J");
  EXPECT_THAT(error(), HasSubstr("no number: '12 J'"));
}

TEST(Meters, OneThatFailsWhenFoundIsListedWithItsProblem) {
  const test::SysfsTree tree;
  make_jetson(tree);
  tree.fail_with_eio("bus/i2c/drivers/ina3221/1-0040/hwmon/hwmon1/curr2_input");
  const auto found = discover_meters(tree.root());
  EXPECT_EQ(found.meters.size(), 3U);
  EXPECT_THAT(found.find("VDD_CPU_GPU_CV")->info().problem, HasSubstr("Input/output error"));
  EXPECT_EQ(found.find("VDD_IN")->info().problem, "");
}

}  // namespace
}  // namespace pirt
