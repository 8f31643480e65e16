// The meter of NVIDIA's boards, with a library that stands in for the driver's.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "characterize/campaign/campaign_meters.h"
#include "characterize/energy/choice.h"
#include "characterize/energy/metered_calls.h"
#include "characterize/energy/window.h"
#include "characterize/worker/measure.h"
#include "tests/characterize/energy/sysfs_tree.h"
#include "tests/support/paths.h"

namespace pirt {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class Nvml : public testing::Test {
 protected:
  Nvml() { library(test::kNvmlStandIn); }
  ~Nvml() override {
    library("none");
    ::unsetenv("NVML_STAND_IN");
  }

  static void library(const std::string& file) { ::setenv("PIRT_NVML", file.c_str(), 1); }
  /// What the library then finds, on a machine without other meters.
  MeterDiscovery discover(const std::string& script, bool device_open = false) const {
    ::setenv("NVML_STAND_IN", script.c_str(), 1);
    return discover_meters(tree_.root(), device_open);
  }
  [[nodiscard]] MeterChoice choose(const MeterDiscovery& found, const std::string& pci) const {
    UnitModel unit;
    unit.name = "opencl";
    return choose_meters(found, {.unit = unit, .pci = pci}, tree_.root());
  }
  [[nodiscard]] std::string problem(const std::string& script, bool device_open = false) const {
    return discover(script, device_open).meters.at(0)->info().problem;
  }

  /// Of unit gpu on a board where it has nothing but what @p keys say.
  [[nodiscard]] CampaignPlan planned(const std::string& script, const std::string& keys) const {
    ::setenv("NVML_STAND_IN", script.c_str(), 1);
    CampaignOptions options;
    options.platform = parse_platform(
        "t.yaml", "platform: t\nunits: {gpu: {backend: opencl" + keys + "}}\n", {}, 1);
    options.sysfs = tree_.root();
    CampaignPlan plan;
    plan.units = {{"gpu", "opencl", "a gpu", false, {}}};
    plan.provenances = {Provenance::kMeasured};
    plan_meters(options, plan);
    return plan;
  }

  const test::SysfsTree tree_;
};

TEST_F(Nvml, ABoardCountsItsEnergyInMicrojoules) {
  const auto found = discover("boards=c1 rest_w=80");
  ASSERT_THAT(found.names(), ElementsAre("nvidia/0000:c1:00.0"));
  const Meter& meter = *found.meters[0];
  EXPECT_EQ(meter.info().kind, MeterKind::kCounter);
  EXPECT_EQ(meter.info().domain, MeterDomain::kGpu);
  EXPECT_EQ(meter.info().pci, "0000:c1:00.0");
  EXPECT_EQ(meter.info().problem, "");
  EXPECT_TRUE(meter.info().steps);
  EXPECT_EQ(meter.read().value.value() % 1000, 0) << "it counts millijoules";
  EXPECT_EQ(update_period(meter, MachineClock()).has_value(), true);
}

TEST_F(Nvml, ABoardThatCountsNoEnergyGivesItsPower) {
  const auto gives_power = [](const MeterDiscovery& found) {
    const Meter& meter = *found.meters.at(0);
    return meter.info().kind == MeterKind::kPower && meter.read().value == 45'500'000;
  };
  EXPECT_TRUE(gives_power(discover("energy_status=3 rest_w=45.5"))) << "before Volta";
  library(test::kNvmlStandInOld);
  EXPECT_TRUE(gives_power(discover("rest_w=45.5"))) << "a driver without the function";
  const auto neither = discover("power_status=3");
  EXPECT_THAT(neither.meters, IsEmpty());
  EXPECT_THAT(neither.missing, Contains(HasSubstr("neither energy nor power")));
}

TEST_F(Nvml, WithoutLibraryDriverOrBoardThereIsNoMeterAndItSaysWhy) {
  const auto missing = [&](const std::string& script) {
    const auto found = discover(script);
    EXPECT_THAT(found.meters, IsEmpty());
    return found.missing;
  };
  EXPECT_THAT(missing("init=9"), Contains(HasSubstr("nvidia-smi says more")));
  EXPECT_THAT(missing("boards="), Contains("NVML: the driver has no board"));
  library("/nonexistent/libnvidia-ml.so.1");
  EXPECT_THAT(missing(""), Contains(HasSubstr("/nonexistent/libnvidia-ml.so.1")));
  library("libm.so.6");
  EXPECT_THAT(missing(""), Contains(HasSubstr("too old")));
}

TEST_F(Nvml, ABoardInPartsIsNoMeter) {
  EXPECT_THAT(problem("mig=1"), HasSubstr("MIG is on"));
  const auto found = discover("mig=1");
  EXPECT_EQ(found.meters[0]->read().value, std::nullopt);
  const auto choice = choose(found, "0000:01:00.0");
  EXPECT_THAT(choice.meters, IsEmpty());
  EXPECT_THAT(choice.remark, HasSubstr("MIG is on"));
}

TEST_F(Nvml, WithoutMeterThereIsAModelOnlyWhereThereAreWatts) {
  const auto remark = [&](const std::string& keys) {
    return planned("mig=1", keys).facts.at("meter.gpu_unknown");
  };
  EXPECT_THAT(remark(""), HasSubstr("energy of unit gpu is not known: nvidia/"));
  EXPECT_THAT(remark(", active_w: 5, watts_of: host_cores"),
              HasSubstr("gpu is not known: nvidia/"));
  EXPECT_THAT(remark(", active_w: 5"), HasSubstr("energy of unit gpu is modelled: nvidia/"));
}

TEST_F(Nvml, WhatItsStepsTakeIsKeptForEachCell) {
  CampaignPlan plan = planned("step_ms=20", "");
  MeterRequest& meter = plan.meters.at("gpu");
  EXPECT_GE(meter.step, std::chrono::milliseconds(18));
  // Three times 15 steps and three windows of 5; opening and preparing takes 2 s.
  meter.step = std::chrono::milliseconds(200);
  meter.window = metering_window({}, meter.window, meter.step);
  EXPECT_EQ(metering_time(plan, "gpu"), std::chrono::seconds(20));
  EXPECT_EQ(metering_time(plan, "cpu"), Nanos(0));
}

TEST_F(Nvml, ABoardThatOthersComputeOnIsNoMeter) {
  const std::string own = std::to_string(::getpid());
  EXPECT_THAT(problem("pids=1"), HasSubstr("1 other process computes on the board"));
  EXPECT_THAT(problem("pids=1,2"), HasSubstr("2 other processes compute"));
  EXPECT_EQ(problem("pids=" + own), "");
  // Whoever started the program is a stranger, and a worker's coordinator is none.
  const std::string parent = std::to_string(::getppid());
  EXPECT_THAT(problem("pids=" + parent), HasSubstr("1 other process"));
  EXPECT_THAT(problem("pids=" + parent + "," + own), HasSubstr("1 other process"));
  EXPECT_EQ(problem("pids=" + parent + "," + own, true), "");
  EXPECT_THAT(problem("pids=1," + own, true), HasSubstr("1 other process"));
  // In a container their numbers are those outside: how many there are is all that is known.
  EXPECT_EQ(problem("pids=1", true), "");
  EXPECT_THAT(problem("pids=1,2", true), HasSubstr("1 other process"));
  library(test::kNvmlStandInOld);
  EXPECT_THAT(problem("pids=1"), HasSubstr("1 other process")) << "by the list of before";
}

TEST_F(Nvml, ADriverThatDoesNotTellWhoComputesIsSaid) {
  const auto found = discover("pids_status=3");
  EXPECT_EQ(found.meters.at(0)->info().problem, "");
  EXPECT_THAT(found.missing, Contains(HasSubstr("does not tell who else computes")));
}

TEST_F(Nvml, OfTwoBoardsTheDevicesOwnIsTaken) {
  const auto found = discover("boards=01,41");
  EXPECT_EQ(names_of(choose(found, "0000:41:00.0").meters), "nvidia/0000:41:00.0");
  EXPECT_EQ(choose(found, "0000:41:00.0").remark, "");
  for (const auto* unknown : {"", "0000:81:00.0"}) {
    EXPECT_THAT(choose(found, unknown).meters, IsEmpty());
    EXPECT_THAT(choose(found, unknown).remark, HasSubstr("--set opencl.meter=NAME"));
  }
}

TEST_F(Nvml, AnOnlyBoardIsTakenForADeviceThatDoesNotSayWhichItIs) {
  const auto found = discover("boards=01");
  const auto choice = choose(found, "");
  EXPECT_EQ(names_of(choice.meters), "nvidia/0000:01:00.0");
  EXPECT_THAT(choice.remark, HasSubstr("the only board with a meter"));
  EXPECT_THAT(choose(found, "0000:02:00.0").meters, IsEmpty());
}

// What a server draws as a whole, by an ACPI power meter, is none of a card's energy.
TEST_F(Nvml, ACardWithAMeterOfItsOwnHasNoOther) {
  tree_.write("class/hwmon/hwmon0/name", "power_meter");
  tree_.write("class/hwmon/hwmon0/power1_average", "1200000000");
  const auto found = discover("boards=01");
  EXPECT_EQ(names_of(choose(found, "0000:01:00.0").meters), "nvidia/0000:01:00.0");
  EXPECT_EQ(choose(found, "0000:01:00.0").remark, "");
  for (const auto* unknown : {"", "0000:81:00.0"}) {
    EXPECT_EQ(names_of(choose(found, unknown).meters), "power_meter/power1");
  }
  const auto in_parts = discover("boards=01 mig=1");
  EXPECT_THAT(choose(in_parts, "0000:01:00.0").meters, IsEmpty());
  EXPECT_THAT(choose(in_parts, "0000:01:00.0").remark, HasSubstr("MIG is on"));
}

TEST_F(Nvml, ALostBoardIsAFailedReading) {
  const auto found = discover("");
  ::setenv("NVML_STAND_IN", "energy_status=15", 1);
  EXPECT_THAT(found.meters[0]->read().error, HasSubstr("GPU is lost"));
  const std::vector<const Meter*> meters = {found.meters[0].get()};
  const auto metered = meter_calls(meters, MachineClock(), Nanos(0), [] {});
  EXPECT_THAT(metered.reasons, ElementsAre(HasSubstr("meter_error: ")));
}

TEST_F(Nvml, WindowsBeginAndEndAtAStep) {
  const auto found = discover("step_ms=50 rest_w=100");
  const std::vector<const Meter*> meters = {found.meters[0].get()};
  EXPECT_GE(update_period(*meters[0], MachineClock()).value(), std::chrono::milliseconds(45));
  const MachineClock clock;
  MeterRecorder recorder(meters, clock);
  const auto trace = recorder.stop().at(0);
  ASSERT_EQ(trace.readings.size(), 2U);
  EXPECT_EQ(trace.begin, trace.readings[0].at);
  EXPECT_EQ(trace.end, trace.readings[1].at);
  EXPECT_GT(trace.readings[1].value, trace.readings[0].value);
}

TEST_F(Nvml, ACounterThatStandsStillIsFrozen) {
  const auto found = discover("still=yes");
  const std::vector<const Meter*> meters = {found.meters[0].get()};
  EXPECT_EQ(update_period(*meters[0], MachineClock()), std::nullopt);
  const auto metered = meter_calls(meters, MachineClock(), Nanos(0), [] {});
  EXPECT_THAT(metered.reasons, ElementsAre("meter_frozen"));
}

}  // namespace
}  // namespace pirt
