#include "characterize/worker/reread.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "characterize/platform/platform.h"
#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"

namespace pirt {
namespace {

TEST(Reread, TakesAsManySamplesAsAskedForAndLeavesTheThreadItsCores) {
  const auto cores = usable_cores();
  if (!Reread::possible(cores)) GTEST_SKIP() << "the machine does not say how much its caches hold";
  const auto before = current_cores();
  Reread reread(cores);
  EXPECT_EQ(reread.after({Nanos(0), 3}).size(), 3U);
  EXPECT_EQ(reread.after({std::chrono::microseconds(100), 2}).size(), 2U);
  const auto cold = reread.cold(2);
  EXPECT_EQ(cold.size(), 2U);
  EXPECT_GT(std::ranges::min(cold), Nanos(0));
  EXPECT_EQ(current_cores(), before);
}

TEST(Reread, SaysThatItsCoresAreNotThere) {
  if (!Reread::possible({4095})) GTEST_SKIP() << "the machine does not say how much they hold";
  Reread reread({4095});
  EXPECT_THROW(static_cast<void>(reread.after({Nanos(0), 1})), Error);
}

TEST(Reread, PlansRiseFromNoSleep) {
  const auto plans = Reread::plans();
  EXPECT_EQ(plans.front().sleep, Nanos(0));
  EXPECT_TRUE(std::ranges::is_sorted(plans, {}, &SleepPlan::sleep));
}

}  // namespace
}  // namespace pirt
