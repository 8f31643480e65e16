#include "characterize/energy/choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "characterize/energy/metered_calls.h"
#include "tests/characterize/energy/sysfs_tree.h"

namespace pirt {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

UnitModel unit_with(const std::string& meter, std::vector<int> cores = {}) {
  UnitModel unit;
  unit.name = "cpu";
  unit.backend = "cpu";
  unit.meter = meter;
  unit.cores = std::move(cores);
  return unit;
}

struct Choice {
  std::string meters;
  std::string remark;
};

Choice choose(const test::SysfsTree& tree, const UnitModel& unit, bool device_is_cpu = true,
              bool simulated = false, bool has_model = true) {
  const auto found = discover_meters(tree.root());
  const auto choice =
      choose_meters(found, {unit, device_is_cpu, simulated, "", has_model}, tree.root());
  return {names_of(choice.meters), choice.remark};
}

void add_board(const test::SysfsTree& tree) {
  tree.add_channel("1-0040", "hwmon1", 1, "VDD_IN", 5000, 1000);
  tree.add_channel("1-0040", "hwmon1", 2, "VDD_GPU_SOC", 5000, 100);
}

TEST(MeterChoice, CoresTakeTheirPackageAndOtherDevicesTheBoard) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  tree.add_rapl("intel-rapl:0:0", "core", 1);
  add_board(tree);
  EXPECT_EQ(choose(tree, unit_with("")).meters, "package-0");
  EXPECT_EQ(choose(tree, unit_with(""), false).meters, "VDD_IN");
}

TEST(MeterChoice, CoresOnABoardWithoutRaplTakeItsInput) {
  const test::SysfsTree tree;
  add_board(tree);
  EXPECT_EQ(choose(tree, unit_with("")).meters, "VDD_IN");
}

TEST(MeterChoice, TakesThePackagesThatOwnTheCores) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  tree.add_rapl("intel-rapl:1", "package-1", 1);
  tree.write("devices/system/cpu/cpu0/topology/physical_package_id", "0");
  tree.write("devices/system/cpu/cpu1/topology/physical_package_id", "1");
  EXPECT_EQ(choose(tree, unit_with("", {1})).meters, "package-1");
  EXPECT_EQ(choose(tree, unit_with("", {0, 1})).meters, "package-0 + package-1");
  EXPECT_EQ(choose(tree, unit_with("")).meters, "package-0 + package-1");
}

TEST(MeterChoice, TheGpusOwnSensorServesItWhereTheBoardHasNone) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  tree.write("class/hwmon/hwmon0/name", "amdgpu");
  tree.write("class/hwmon/hwmon0/power1_input", "45000000");
  EXPECT_EQ(choose(tree, unit_with(""), false).meters, "amdgpu/power1");
}

TEST(MeterChoice, WhatAnApuDrawsIsThePackagesAndCountedOnce) {
  const test::SysfsTree tree;
  tree.write("class/hwmon/hwmon0/name", "amdgpu");
  tree.write("class/hwmon/hwmon0/power1_input", "45000000");
  tree.write("class/hwmon/hwmon0/in1_label", "vddnb");
  EXPECT_EQ(choose(tree, unit_with(""), false).meters, "") << "it is not the GPU's alone";
  EXPECT_EQ(choose(tree, unit_with("")).meters, "amdgpu/power1");
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  EXPECT_EQ(choose(tree, unit_with("")).meters, "package-0");
}

TEST(MeterChoice, APackagesMeterThatMayBeReadComesBeforeOneThatMayNot) {
  const test::SysfsTree tree;
  tree.write("class/hwmon/hwmon0/name", "amdgpu");
  tree.write("class/hwmon/hwmon0/power1_input", "45000000");
  tree.write("class/hwmon/hwmon0/in1_label", "vddnb");
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  tree.fail_with_eio("class/powercap/intel-rapl:0/energy_uj");
  const auto choice = choose(tree, unit_with(""));
  EXPECT_EQ(choice.meters, "amdgpu/power1");
  EXPECT_THAT(choice.remark, IsEmpty());
}

TEST(MeterChoice, RailsThatMayOverlapAreNotGuessedAt) {
  const test::SysfsTree tree;
  tree.add_channel("1-0040", "hwmon1", 1, "VDD_GPU_SOC", 5000, 1000);
  tree.add_channel("1-0040", "hwmon1", 2, "VDD_CPU_CV", 5000, 100);
  const auto choice = choose(tree, unit_with(""));
  EXPECT_THAT(choice.meters, IsEmpty());
  EXPECT_THAT(choice.remark, HasSubstr("--set cpu.meter=NAME"));
  EXPECT_EQ(choose(tree, unit_with("VDD_GPU_SOC + VDD_CPU_CV")).meters, "VDD_GPU_SOC + VDD_CPU_CV");
}

TEST(MeterChoice, WhatCannotBeReadIsSaidAndTheNextOneTaken) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  tree.fail_with_eio("class/powercap/intel-rapl:0/energy_uj");
  auto choice = choose(tree, unit_with(""));
  EXPECT_THAT(choice.meters, IsEmpty());
  EXPECT_THAT(choice.remark, HasSubstr("energy of unit cpu is modelled: package-0: "));
  add_board(tree);
  choice = choose(tree, unit_with(""));
  EXPECT_EQ(choice.meters, "VDD_IN");
  EXPECT_THAT(choice.remark, HasSubstr("is read from VDD_IN: package-0: "));
}

TEST(MeterChoice, AMeterThatIsAskedForMustBeReadable) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  tree.fail_with_eio("class/powercap/intel-rapl:0/energy_uj");
  const auto message = test::error_of(ErrorCode::kEnvironment,
                                      [&] { return choose(tree, unit_with("package-0")).meters; });
  EXPECT_THAT(message, HasSubstr("Input/output error"));
}

TEST(MeterChoice, SimulatedUnitsHaveOneOnlyByName) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  EXPECT_THAT(choose(tree, unit_with(""), true, true).meters, IsEmpty());
  EXPECT_EQ(choose(tree, unit_with("package-0"), true, true).meters, "package-0");
  EXPECT_THAT(choose(tree, unit_with("none")).meters, IsEmpty());
  EXPECT_THAT(choose(tree, unit_with("none")).remark, IsEmpty());
}

TEST(MeterChoice, ADeviceOfItsOwnHasNoWattsOfTheHostsCores) {
  const test::SysfsTree tree;
  UnitModel unit = unit_with("");
  const auto remark = [&] { return choose(tree, unit, false, false, false).remark; };
  EXPECT_THAT(remark(), HasSubstr("cpu is not known: its device has no meter; give it with"));
  unit.watts_of_host_cores = true;
  EXPECT_EQ(choose(tree, unit).remark, "");
  EXPECT_THAT(remark(), HasSubstr("no meter, and the platform's watts are of the host's cores"));
  tree.write("class/hwmon/hwmon0/name", "amdgpu");
  tree.fail_with_eio("class/hwmon/hwmon0/power1_input");
  EXPECT_THAT(remark(), HasSubstr("is not known: amdgpu/power1: "));
}

TEST(MeterChoice, WithoutMetersThereIsNothingToSay) {
  const test::SysfsTree tree;
  EXPECT_THAT(choose(tree, unit_with("")).remark, IsEmpty());
}

}  // namespace
}  // namespace pirt
