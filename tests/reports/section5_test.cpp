// Section V's robot: what is fitted comes out as printed, and the other units' times are the
// paper's ratios of it.
#include "reports/paper/section5.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "characterize/platform/platform.h"

namespace pirt {
namespace {

TEST(Section5, WithoutTheRuntimeGivesWhatThePaperPrints) {
  const auto section = run_section5();
  EXPECT_NEAR(section.fitted.localization_fps, 15, 0.1);
  EXPECT_NEAR(section.fitted.recognitions_per_s, 1 / 1.5, 0.02);
  EXPECT_NEAR(section.fitted.power_w, 10, 0.1);
}

TEST(Section5, OtherUnitsFollowFromTheCpuByThePapersRatios) {
  const auto platform = load_platform("snapdragon820-section5");
  const auto total_ms = [&](const std::string& workload, const std::string& unit) {
    double sum = 0;
    for (const auto& stage : platform.workloads.at(workload).stages.at(unit)) {
      sum += to_ms(stage.time.mean());
    }
    return sum;
  };
  // Table IV: 0.033 s on the GPU, 0.400 s on the CPU.
  EXPECT_NEAR(total_ms("alexnet", "gpu") / total_ms("alexnet", "cpu"), 0.033 / 0.4, 1e-6);
  for (const char* workload : {"feature_detect", "optical_flow"}) {
    for (const char* unit : {"gpu", "dsp"}) {
      EXPECT_NEAR(total_ms(workload, unit) / total_ms(workload, "cpu"),
                  total_ms("convolution", unit) / total_ms("convolution", "cpu"), 1e-3)
          << workload << " on " << unit;
    }
  }
}

TEST(Section5, EachModeOfThePaperButEnergyPredictsSomething) {
  const auto section = run_section5();
  for (const char* mode : {"latency", "throughput", "advanced", "cpu-only"}) {
    EXPECT_EQ(std::ranges::count(section.predictions, mode, &Section5Row::mode), 1) << mode;
  }
  EXPECT_FALSE(section.placed.empty());
  // Energy gives the CPU no weight, which alone computes poses.
  EXPECT_TRUE(std::ranges::any_of(section.not_run, [](const std::string& line) {
    return line.starts_with("section5, mode energy: ");
  }));
}

}  // namespace
}  // namespace pirt
