#include "scheduler/unit_times/handover.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "characterize/platform/platform.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

TEST(Handover, TakesAsManySamplesAsAskedForAndNoneBeforeItBegan) {
  const std::vector<int> core = {usable_cores().front()};
  for (const SleepPlan& plan :
       {SleepPlan{Nanos(0), 20}, SleepPlan{std::chrono::microseconds(100), 5}}) {
    const auto times = measure_handover(core, plan);
    ASSERT_EQ(times.size(), static_cast<std::size_t>(plan.samples));
    EXPECT_GE(std::ranges::min(times), Nanos(0));
    EXPECT_LT(std::ranges::max(times), std::chrono::seconds(60));
  }
}

TEST(Handover, SaysThatItsCoresAreNotThere) {
  EXPECT_THROW(static_cast<void>(measure_handover({4095}, {Nanos(0), 1})), Error);
}

TEST(Handover, PlansRiseFromNoSleep) {
  const auto plans = handover_plans();
  EXPECT_EQ(plans.front().sleep, Nanos(0));
  EXPECT_TRUE(std::ranges::is_sorted(plans, {}, &SleepPlan::sleep));
}

}  // namespace
}  // namespace pirt
