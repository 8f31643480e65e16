// What the OpenCL backend does on the host: launch times from stamps, corners from candidates. No
// device is needed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "workloads/backends/opencl/plan/launch_times.h"
#include "workloads/vision/corners.h"

namespace pirt::opencl {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(LaunchSum, CountsFromSubmissionWhereTheDeviceWasIdle) {
  LaunchSum sum;
  sum.add(Nanos{100}, Nanos{130}, Nanos{200});  // 30: nothing ran before.
  sum.add(Nanos{500}, Nanos{540},
          Nanos{600});  // 40: the one before ended at 200, earlier than 500.
  EXPECT_EQ(sum.total(), Nanos{70});
}

TEST(LaunchSum, CountsFromThePreviousEndWhereTheDeviceWasBusy) {
  LaunchSum sum;
  sum.add(Nanos{0}, Nanos{10}, Nanos{200});  // 10
  sum.add(Nanos{20}, Nanos{205},
          Nanos{300});  // 5: queued at 20, but the device was busy until 200.
  EXPECT_EQ(sum.total(), Nanos{15});
}

TEST(LaunchSum, NeverSubtracts) {
  LaunchSum sum;
  sum.add(Nanos{0}, Nanos{10}, Nanos{200});
  sum.add(Nanos{20}, Nanos{190}, Nanos{300});  // Overlapping stamps of a careless driver.
  EXPECT_EQ(sum.total(), Nanos{10});
}

// Rows of 100 pixels.
vision::FeatureDetect image() {
  vision::FeatureDetect operation;
  operation.width = 100;
  operation.height = 100;
  return operation;
}

std::uint64_t candidate(std::uint64_t strength, int x, int y) {
  return strength << 32 | static_cast<std::uint64_t>(y * 100 + x);
}

TEST(Corners, ComeStrongestFirst) {
  std::vector candidates = {candidate(1, 10, 10), candidate(3, 50, 10), candidate(2, 30, 10)};
  EXPECT_THAT(vision::select_corners(candidates, image()),
              ElementsAre(vision::Corner{50, 10}, vision::Corner{30, 10}, vision::Corner{10, 10}));
}

TEST(Corners, OfEqualStrengthComeTheLaterPixelFirst) {
  std::vector candidates = {candidate(1, 10, 10), candidate(1, 10, 40), candidate(1, 80, 10)};
  EXPECT_THAT(vision::select_corners(candidates, image()),
              ElementsAre(vision::Corner{10, 40}, vision::Corner{80, 10}, vision::Corner{10, 10}));
}

TEST(Corners, KeepTenPixelsFromEveryStrongerAcceptedOne) {
  // (28, 20) is 8 from the accepted (20, 20) and goes; (36, 20) is 8 from (28, 20), which was not
  // accepted, and 16 from (20, 20): it stays. (30, 20) would be exactly 10 away, and exactly 10 is
  // enough.
  std::vector candidates = {candidate(9, 20, 20), candidate(8, 28, 20), candidate(7, 36, 20)};
  EXPECT_THAT(vision::select_corners(candidates, image()),
              ElementsAre(vision::Corner{20, 20}, vision::Corner{36, 20}));
  candidates = {candidate(9, 20, 20), candidate(8, 30, 20)};
  EXPECT_THAT(vision::select_corners(candidates, image()),
              ElementsAre(vision::Corner{20, 20}, vision::Corner{30, 20}));
  // 6 and 8 across cells: 36 + 64 = 100 is enough, 6 and 7 is not.
  candidates = {candidate(9, 19, 19), candidate(8, 25, 27), candidate(7, 13, 12)};
  EXPECT_THAT(vision::select_corners(candidates, image()),
              ElementsAre(vision::Corner{19, 19}, vision::Corner{25, 27}));
}

TEST(Corners, EndAtFiveHundred) {
  vision::FeatureDetect wide;
  wide.width = 6000;
  wide.height = 11;
  std::vector<std::uint64_t> candidates;
  for (std::uint64_t i = 0; i < 600; ++i) candidates.push_back((1000 - i) << 32 | (i * 10));
  const auto corners = vision::select_corners(candidates, wide);
  ASSERT_EQ(corners.size(), 500U);
  EXPECT_EQ(corners.back(), (vision::Corner{4990, 0}));
}

TEST(Corners, OfNothingAreNone) {
  std::vector<std::uint64_t> none;
  EXPECT_THAT(vision::select_corners(none, image()), IsEmpty());
}

}  // namespace
}  // namespace pirt::opencl
