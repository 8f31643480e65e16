#include "characterize/energy/fitted_platform.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "characterize/energy/model.h"
#include "tests/characterize/support.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

PhaseRow call_row(const std::string& workload, const std::string& unit, double seconds) {
  PhaseRow row;
  row.run_id = 3;
  row.workload = workload;
  row.unit = unit;
  row.median = Nanos(static_cast<std::int64_t>(seconds * 1e9));
  row.ops = 1'000'000;
  row.bytes = 1000;
  return row;
}

EnergyRow energy_row(const std::string& workload, const std::string& unit, double energy_j) {
  EnergyRow row;
  row.run_id = 3;
  row.workload = workload;
  row.unit = unit;
  row.energy_j = energy_j;
  row.provenance = Provenance::kMeasured;
  return row;
}

/// Two units on one package, which idles at 3 W. `cpu` draws 8 W while it is busy.
Profile metered_profile() {
  Profile profile;
  RunInfo run;
  run.run_id = 3;
  run.started = "2026-01-02T03:04:05Z";
  run.platform = "host";
  run.units = {{"cpu", "cpu", "a cpu", true, {0}}, {"opencl", "opencl", "pocl", true, {1}}};
  for (const auto* unit : {"cpu", "opencl"}) {
    run.environment[std::string("meter.") + unit] = "rapl: package-0 (package)";
    run.environment[std::string("meter.") + unit + ".idle_w"] = "3";
  }
  profile.runs = {run};
  int i = 1;
  for (const auto* workload : {"sobel", "convolution", "fc8", "fc7", "conv1"}) {
    profile.phases.push_back(call_row(workload, "cpu", 1e-3 * i));
    profile.energies.push_back(energy_row(workload, "cpu", 8e-3 * i));
    ++i;
  }
  return profile;
}

const std::vector<EnergyParameter> kActiveOnly = {EnergyParameter::kActive};

TEST(FittedPlatform, UsesTheNewestRunsMeteredRows) {
  Profile profile = metered_profile();
  const Platform host = load_platform("host");
  const auto cells = [&](const char* unit) { return fit_cells(profile, host, host.unit(unit)); };
  profile.energies[4].doubts = {"contended"};  // Of a busy machine.
  EXPECT_THAT(cells("cpu"), SizeIs(5));
  EXPECT_THAT(cells("opencl"), IsEmpty());
  profile.energies[0].reasons = {"wrong_output"};
  profile.energies[1].provenance = Provenance::kModelled;
  profile.energies[2].run_id = 2;
  profile.phases[3].reasons = {"wrong_output"};
  ASSERT_THAT(cells("cpu"), SizeIs(1));
  const FitCell cell = cells("cpu")[0];
  EXPECT_EQ(cell.workload, "conv1");
  EXPECT_DOUBLE_EQ(cell.seconds, 5e-3);
  EXPECT_DOUBLE_EQ(cell.energy_j, 40e-3);
  EXPECT_EQ(cell.ops, 1'000'000);
}

// Of 10 ms a call uploads and downloads for 2, which draw 16 mJ: 8 W. What the platform states of
// the workload is drawn besides.
TEST(FittedPlatform, TakesOfACallElsewhereWhatTheModelTakes) {
  Platform platform;
  UnitModel cloud;
  cloud.name = "cloud";
  cloud.role = Role::kCloud;
  cloud.backend = "nats";
  platform.units = {cloud};
  platform.workloads["sobel"].call_j["cloud"] = 0.5;
  Profile profile;
  RunInfo run;
  run.run_id = 3;
  run.units = {{"cloud", "nats", "a cloud", false, {}}};
  run.environment["meter.cloud"] = "power_supply: BAT0 (platform)";
  profile.runs = {run};
  for (const auto* workload : {"sobel", "convolution", "fc8"}) {
    profile.phases.push_back(call_row(workload, "cloud", 0.010));
    for (const Phase phase : {Phase::kUpload, Phase::kExecute, Phase::kDownload}) {
      const double seconds = phase == Phase::kExecute ? 0.008 : 0.001;
      profile.phases.push_back(call_row(workload, "cloud", seconds));
      profile.phases.back().phase = phase;
    }
    profile.energies.push_back(energy_row(workload, "cloud", 0.016));
  }
  profile.energies[0].energy_j = 0.516;
  const auto fits = fit_units(profile, platform, kActiveOnly);
  ASSERT_THAT(fits, SizeIs(1));
  ASSERT_EQ(fits[0].fit.refusal, "");
  EXPECT_NEAR(fits[0].fit.parameters.at(0).value, 8, 1e-6);
  EXPECT_EQ(fits[0].fit.residuals.size(), 3U);
}

TEST(FittedPlatform, UnitsThatShareAMeterShareItsIdlePower) {
  Profile profile = metered_profile();
  profile.runs.front().environment["meter.cpu.awake_w"] = "5";
  const auto fits = fit_units(profile, load_platform("host"), kActiveOnly);
  ASSERT_THAT(fits, SizeIs(2));
  EXPECT_DOUBLE_EQ(fits[0].idle_w.value(), 1.5);
  EXPECT_DOUBLE_EQ(fits[0].held_w.value(), 1.0);
  EXPECT_NEAR(fits[0].fit.parameters.at(0).value, 8, 1e-6);
  EXPECT_THAT(fits[1].fit.refusal, HasSubstr("0 usable cells"));
}

TEST(FittedPlatform, TheSettingsMakeAPlatformWhoseModelIsFitted) {
  const Platform host = load_platform("host");
  const auto settings = fitted_settings(fit_units(metered_profile(), host, kActiveOnly));
  for (const auto& setting : settings) EXPECT_TRUE(setting.path.starts_with("cpu."));
  const std::string text = platform_text(host, settings);
  const Platform platform = parse_platform("fitted.yaml", text, {}, 2);
  const UnitModel& cpu = platform.unit("cpu");
  EXPECT_NEAR(cpu.active_w, 8, 1e-4);
  EXPECT_DOUBLE_EQ(cpu.idle_w, 1.5);
  EXPECT_EQ(cpu.energy_provenance, Provenance::kFitted);
  for (const UnitModel& shipped : host.units) {
    if (shipped.name == "cpu") continue;
    EXPECT_EQ(platform.unit(shipped.name).active_w, shipped.active_w);
    EXPECT_EQ(platform.unit(shipped.name).energy_provenance, shipped.energy_provenance);
  }

  PhaseRecord call;
  call.phase = Phase::kCall;
  call.samples = {from_ms(2)};
  const auto energy = model_energy(platform, cpu, find_workload("sobel"), call);
  EXPECT_NEAR(energy.energy_j.value(), 0.016, 1e-6);
  EXPECT_EQ(energy.provenance, Provenance::kFitted);
  EXPECT_THAT(energy.source, HasSubstr("fitted to 5 cells of rapl: package-0 (package), run 3 of "
                                       "2026-01-02T03:04:05Z"));
}

TEST(FittedPlatform, TextOfAPlatformIsThatPlatform) {
  for (const auto& name : shipped_platforms()) {
    const auto read = parse_platform(name, platform_text(load_platform(name), {}), {}, 4);
    EXPECT_EQ(read.unit_names(), load_platform(name).unit_names()) << name;
  }
  const auto host = load_platform("host", {{"cpu.idle_w", "4"}});
  EXPECT_THAT(platform_text(host, {{"cpu.active_w", "15"}}),
              AllOf(HasSubstr("active_w: 15"), HasSubstr("idle_w: 4")));
}

}  // namespace
}  // namespace pirt
