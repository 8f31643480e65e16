#include "scheduler/unit_times/leave.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "characterize/platform/platform.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

TEST(Leave, TakesAsManySamplesAsAskedFor) {
  const auto times = measure_leave({usable_cores().front()}, 20);
  ASSERT_EQ(times.size(), 20U);
  EXPECT_GT(std::ranges::min(times), Nanos(0));
}

TEST(Leave, SaysThatItsCoresAreNotThere) {
  EXPECT_THROW(static_cast<void>(measure_leave({4095}, 1)), Error);
}

}  // namespace
}  // namespace pirt
