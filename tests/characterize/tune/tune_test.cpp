// Planning and measuring `pirt tune` through worker processes, and what a campaign says of tuned
// devices.
#include "characterize/tune/tune.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "characterize/campaign/campaign.h"
#include "characterize/machine/environment_keys.h"
#include "characterize/profile/identity.h"
#include "tests/characterize/support.h"
#include "tests/support/paths.h"
#include "tests/workloads/backends/opencl/tuning_support.h"
#include "workloads/backends/opencl/tuning/tuning_file.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

using opencl::Parameter;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class TuneOpenCl : public testing::Test {
 protected:
  void SetUp() override {
    if (!find_backend("opencl").probe().available) GTEST_SKIP() << "skipped: no OpenCL device";
    options_.platform = load_platform("host-opencl");
    options_.filter = "^gaussian_blur$";
    options_.output = folder_ / "tuning.json";
    options_.program = test::kTestWorker;
  }

  /// Defaults of the device, as an entry.
  opencl::TunedDevice entry() const {
    return test::entry_for(plan_tuning(options_).units.at(0).device);
  }

  test::TemporaryFolder folder_;
  TuneOptions options_;
};

TEST_F(TuneOpenCl, PlansEachParameterOfTheChosenWorkloads) {
  options_.filter = "";
  const auto plan = plan_tuning(options_);
  ASSERT_THAT(plan.units, SizeIs(1));
  const TuneUnit& unit = plan.units[0];
  const auto table = opencl::parameter_table();
  const auto searchable = std::ranges::count_if(table, [&](const opencl::ParameterInfo& info) {
    return info.range(unit.device.is_cpu).candidates.size() > 1;
  });
  EXPECT_THAT(unit.steps, SizeIs(static_cast<std::size_t>(searchable)));
  for (const TuneStep& step : unit.steps) EXPECT_THAT(step.workloads, testing::Not(IsEmpty()));
  EXPECT_THAT(unit.remarks, IsEmpty());
  EXPECT_EQ(unit.start, opencl::Tuning(unit.device.is_cpu));
}

TEST_F(TuneOpenCl, StartsFromWhatIsStoredForTheDevice) {
  auto stored = entry();
  stored.tuning.set(Parameter::kFcRows, 2);
  write_file(options_.output, opencl::tuning_text({.devices = {stored}}));
  EXPECT_EQ(plan_tuning(options_).units.at(0).start.describe(), "fc_rows=2");
}

TEST_F(TuneOpenCl, VerifiesAndTimesEachCandidateInAProcess) {
  auto unit = plan_tuning(options_).units.at(0);
  ASSERT_THAT(unit.steps, SizeIs(1));
  std::vector<std::string> steps;
  const auto tuned = tune_unit(
      options_, unit, [&](const std::string& what) { steps.push_back(what); },
      [] { return false; });
  ASSERT_THAT(tuned.outcome.findings, SizeIs(1));
  const TuneFinding& found = tuned.outcome.findings[0];
  EXPECT_NE(found.verdict, TuneVerdict::kNotMeasured) << found.reason;
  EXPECT_THAT(found.rejected, IsEmpty());
  EXPECT_THAT(found.gains, SizeIs(1));
  const auto candidates = found.parameter->range(unit.device.is_cpu).candidates;
  EXPECT_GE(steps.size(), candidates.size());
  for (const int value : candidates) {
    EXPECT_THAT(steps, testing::Contains(HasSubstr(std::to_string(value) + ", gaussian_blur")));
  }
  store_tuning(options_, tuned, "2026-01-02T03:04:05Z");
  const auto file = opencl::load_tuning(options_.output);
  ASSERT_NE(file.find(unit.device), nullptr);
  EXPECT_EQ(file.find(unit.device)->tuning, tuned.outcome.tuning);
}

TEST_F(TuneOpenCl, AWorkerThatDiesCostsTheCandidateAndNotTheRun) {
  auto unit = plan_tuning(options_).units.at(0);
  options_.program = "/bin/false";
  const auto tuned = tune_unit(
      options_, unit, [](const std::string&) {}, [] { return false; });
  ASSERT_THAT(tuned.outcome.findings, SizeIs(1));
  EXPECT_EQ(tuned.outcome.findings[0].verdict, TuneVerdict::kNotMeasured);
  EXPECT_THAT(tuned.outcome.findings[0].reason, HasSubstr("ended with code 1"));
  EXPECT_EQ(tuned.outcome.tuning, unit.start);
}

TEST_F(TuneOpenCl, StoringKeepsOtherDevices) {
  auto other = entry();
  other.version += " of before";
  other.tuning.set(Parameter::kFcRows, 1);
  write_file(options_.output, opencl::tuning_text({.devices = {other}}));
  const auto unit = plan_tuning(options_).units.at(0);
  store_tuning(options_,
               {.unit = "opencl",
                .device = unit.device,
                .outcome = {.tuning = unit.start, .findings = {}, .not_reached = {}},
                .remarks = {}},
               "2026-01-02T03:04:05Z");
  const auto file = opencl::load_tuning(options_.output);
  ASSERT_THAT(file.devices, SizeIs(2));
  EXPECT_EQ(file.devices[0], other);
}

TEST(TuneStoring, KeepsWhatAnotherSearchFoundMeanwhile) {
  const test::TemporaryFolder folder;
  TuneOptions options;
  options.output = folder / "tuning.json";
  DeviceInfo device;
  device.name = "a device";
  device.is_cpu = true;
  auto other = test::entry_for(device);
  other.tuning.set(Parameter::kFcRows, 2);
  write_file(options.output, opencl::tuning_text({.devices = {other}}));
  opencl::Tuning found(true);
  found.set(Parameter::kBlurStripRows, 16);
  TuneFinding blur;
  blur.parameter = &opencl::info_of(Parameter::kBlurStripRows);
  store_tuning(options,
               {.unit = "opencl",
                .device = device,
                .outcome = {.tuning = found, .findings = {blur}, .not_reached = {}},
                .remarks = {}},
               "2026-01-02T03:04:05Z");
  const auto file = opencl::load_tuning(options.output);
  ASSERT_THAT(file.devices, SizeIs(1));
  EXPECT_EQ(file.devices[0].tuning.describe(), "blur_strip_rows=16, fc_rows=2");
}

TEST(TuneTime, IsOfLaunchAndExecuteTogether) {
  using std::chrono::microseconds;
  JobResult result;
  EXPECT_EQ(time_of(result), std::nullopt);
  result.phases.push_back({Phase::kExecute, {microseconds(10)}});
  EXPECT_EQ(time_of(result), microseconds(10));
  result.phases.push_back({Phase::kLaunch, {microseconds(5)}});
  EXPECT_EQ(time_of(result), microseconds(15));
}

// ------------------------------------------------------------------------------------- campaigns

TEST_F(TuneOpenCl, ACampaignRecordsTheParametersOfEachUnit) {
  CampaignOptions campaign;
  campaign.database = folder_ / "p.db";
  campaign.platform = options_.platform;
  campaign.filter = options_.filter;
  campaign.program = test::kTestWorker;
  EXPECT_EQ(plan_campaign(campaign).facts.at("unit.opencl.tuning"), "default");
  auto tuned = entry();
  tuned.tuning.set(Parameter::kFcRows, 1);
  const test::TuningInUse file({tuned});
  EXPECT_EQ(plan_campaign(campaign).facts.at("unit.opencl.tuning"), "fc_rows=1");
  EXPECT_EQ(fact_kind("unit.opencl.tuning"), FactKind::kIdentity);
}

TEST_F(TuneOpenCl, ACampaignRefusesADamagedFile) {
  CampaignOptions campaign;
  campaign.database = folder_ / "p.db";
  campaign.platform = options_.platform;
  campaign.program = test::kTestWorker;
  const test::TuningInUse file("{}");
  try {
    static_cast<void>(plan_campaign(campaign));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr(file.path().string()));
  }
}

TEST(TuneIdentity, RunsOfBeforeThereWasTuningHadTheDefaults) {
  RunInfo before, untuned, tuned;
  for (RunInfo* run : {&before, &untuned, &tuned}) {
    run->units.push_back({"u", "opencl", "a device", true, {0}});
  }
  untuned.environment["unit.u.tuning"] = "default";
  tuned.environment["unit.u.tuning"] = "fc_rows=1";
  EXPECT_THAT(compare_identity(before, untuned), IsEmpty());
  ASSERT_THAT(compare_identity(before, tuned), SizeIs(1));
  EXPECT_EQ(compare_identity(before, tuned)[0].field, "unit.u.tuning");
  EXPECT_EQ(compare_identity(before, tuned)[0].a, "default");
}

}  // namespace
}  // namespace pirt
