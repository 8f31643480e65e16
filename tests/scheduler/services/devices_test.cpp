// What units draw by the devices that they turned out to have.
#include "scheduler/services/devices.h"

#include "scheduler/what_if.h"
#include "tests/scheduler/profile_rows.h"
#include "tests/scheduler/support.h"

namespace pirt::test {
namespace {

using testing::Contains;
using testing::HasSubstr;

/// A platform of which nothing is known of the GPU but what is assumed of the host's cores.
Platform board(const std::vector<YamlOverride>& set = {}) {
  return parse_platform("test.yaml", R"(
platform: board
units:
  cpu: {backend: cpu, slots: 1, active_w: 10, idle_w: 1}
  gpu: {backend: opencl, slots: 1, active_w: 20, idle_w: 2, watts_of: host_cores}
)",
                        set, 4);
}

/// fc8 takes 1 ms on either; the GPU is one of its own, at rest at 79 W and awake at 124 W.
Profile measured(bool metered, bool gpu_is_cpu = false) {
  Profile profile = profile_of({});
  RunInfo& run = profile.runs.front();
  run.units = {{"cpu", "cpu", "a cpu", true, {}}, {"gpu", "opencl", "a gpu", gpu_is_cpu, {}}};
  if (metered) {
    run.environment = {{"meter.gpu.idle_w", "79"}, {"meter.gpu.awake_w", "124"}};
    EnergyRow energy;
    energy.workload = "fc8";
    energy.unit = "gpu";
    energy.energy_j = 0.05;
    energy.provenance = Provenance::kMeasured;
    profile.energies = {energy};
  }
  for (const auto* unit : {"cpu", "gpu"}) {
    for (const Phase phase : {Phase::kExecute, Phase::kCall}) {
      profile.phases.push_back(row_of("fc8", unit, phase, from_ms(1)));
    }
  }
  return profile;
}

/// Each 10 ms for a second: 100 calls.
const Mix& calls() {
  static const Mix mix =
      mix_of("mix: m\npipelines: {p: {rate_hz: 100, tasks: [{name: t, workload: fc8}]}}\n");
  return mix;
}

ScheduleOptions without(const std::string& unit) {
  ScheduleOptions options;
  options.without = {unit};
  return options;
}

ScheduleOptions capped(double power_w) {
  ScheduleOptions options;
  options.power_cap_w = power_w;
  return options;
}

RunRecord run_on(const std::string& mode, const Profile& profile, ScheduleOptions options = {},
                 const Platform& platform = board()) {
  options.mode = mode;
  options.duration = from_s(1);
  return run_virtual(platform, &profile, calls(), options);
}

TEST(Devices, WattsOfTheHostsCoresAreNoneOfADeviceOfItsOwn) {
  const auto gpu_of = [](const Profile& profile, const std::vector<YamlOverride>& set = {}) {
    return on_devices(board(set), &profile).unit("gpu");
  };
  const Profile own = measured(false);
  EXPECT_EQ(gpu_of(own).active_w, 0);
  EXPECT_EQ(gpu_of(own).idle_w, 0);
  EXPECT_EQ(gpu_of(measured(false, true)).active_w, 20) << "PoCL computes on the host's cores";
  EXPECT_EQ(on_devices(board(), nullptr).unit("gpu").active_w, 20) << "nobody knows the device";
  const UnitModel set = gpu_of(own, {{"gpu.active_w", "200"}});
  EXPECT_EQ(set.active_w, 200);
  EXPECT_EQ(set.idle_w, 0) << "which the user did not say";
  EXPECT_EQ(gpu_of(own, {{"gpu.idle_w", "30"}}).idle_w, 30);
  EXPECT_EQ(on_devices(board(), &own).unit("cpu").active_w, 10);
}

TEST(Devices, AMetersRestIsIdleAndWhatItDrawsMoreWhenOpenIsHeld) {
  const Profile profile = measured(true);
  const Platform once = on_devices(board(), &profile);
  EXPECT_EQ(once.unit("gpu").idle_w, 79);
  EXPECT_EQ(once.unit("gpu").held_w, 45);
  EXPECT_EQ(on_devices(once, &profile).unit("gpu").held_w, 45);
  const std::vector<std::string> without = {"gpu"};
  EXPECT_EQ(on_devices(once, &profile, without).unit("gpu").standing_w(), 79);
  const UnitModel set = on_devices(board({{"gpu.idle_w", "30"}}), &profile).unit("gpu");
  EXPECT_EQ(set.standing_w(), 30) << "the user said it";
}

TEST(Devices, UnitsOnOneBoardShareWhatItDraws) {
  Profile profile = measured(true);
  RunInfo& run = profile.runs.front();
  run.units[0] = {"cpu", "opencl", "a gpu", false, {}};
  for (const auto* unit : {"cpu", "gpu"}) {
    const std::string meter = std::string("meter.") + unit;
    run.environment[meter] = "nvml: nvidia/0000:01:00.0 (gpu)";
    run.environment[meter + ".idle_w"] = "79";
    run.environment[meter + ".awake_w"] = "124";
  }
  const UnitModel gpu = on_devices(board(), &profile).unit("gpu");
  EXPECT_EQ(gpu.idle_w, 39.5);
  EXPECT_EQ(gpu.held_w, 22.5);
}

TEST(Devices, ARunIsChargedForHoldingADeviceOpen) {
  const Profile profile = measured(true);
  // 100 calls of 0.05 J, at 124 W and the 1 W of the CPU for a second.
  const auto on_gpu = run_on("energy", profile, without("cpu"));
  ASSERT_EQ(on_gpu.completed, 100);
  EXPECT_NEAR(on_gpu.energy_j.value(), 100 * 0.05 + 124 + 1, 1e-6);
  // 100 calls of 10 W x 1 ms; the board rests.
  const auto on_cpu = run_on("energy", profile, without("gpu"));
  EXPECT_NEAR(on_cpu.energy_j.value(), 100 * 0.01 + 79 + 1, 1e-6);
  EXPECT_THAT(bad_input([&] { return run_on("budget", profile, capped(120)).mode; }),
              HasSubstr("draw 125 W idle"));
}

// The board rests at 79 W and is not held open; the CPU draws 1 W, and 1 J for its calls.
TEST(Devices, ACapIsNotToldOfWhatNobodyOpens) {
  const Profile profile = measured(true);
  ScheduleOptions options = capped(120);
  options.without = {"gpu"};
  options.duration = from_s(1);
  const WhatIf found = what_if(on_devices(board(), &profile), &profile, calls(), {"ect"},
                               {.kind = WhatIfChange::Kind::kPowerCap, .pipeline = ""}, options);
  ASSERT_TRUE(found.rows[0].holds);
  EXPECT_NEAR(*found.rows[0].holds, 81, 1);
}

TEST(Devices, WithoutMeterOrWattsTheEnergyOfARunIsUnknownAndModesSayWhatTheyGoBy) {
  const Profile profile = measured(false);
  for (const auto& [mode, what] :
       {std::pair{"energy", "goes by the units' roles alone, as Algorithm 3 does"},
        {"mee", "takes such a unit where no other can serve"},
        {"budget", "plans for deadlines and rate or latency, whatever its objective"}}) {
    ScheduleOptions options;
    if (mode == std::string("budget")) options.objective = Objective::kEnergy;
    const auto record = run_on(mode, profile, options);
    EXPECT_EQ(record.completed, 100) << mode;
    EXPECT_THAT(record.warnings, Contains(std::string("mode ") + mode + " " + what +
                                          ": nobody knows the joules of gpu"));
    EXPECT_THAT(record.warnings, Contains(HasSubstr("the energy of gpu is not known"))) << mode;
  }
  EXPECT_EQ(run_on("energy", profile).energy_j, std::nullopt);
  EXPECT_THAT(bad_input([&] { return run_on("budget", profile, capped(120)).mode; }),
              HasSubstr("--power-cap: nobody knows what gpu draws"));
  const auto set = run_on("energy", profile, without("cpu"), board({{"gpu.active_w", "30"}}));
  EXPECT_NEAR(set.energy_j.value(), 100 * 0.03 + 1, 1e-6);
}

}  // namespace
}  // namespace pirt::test
