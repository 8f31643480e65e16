#include "characterize/campaign/precision_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pirt {
namespace {

using std::chrono::seconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<std::size_t> chosen(const std::vector<std::optional<Nanos>>& needed, Nanos left) {
  return within_reach(needed, left);
}

TEST(PrecisionPlan, TakesThoseThatNeedTheLeastAsFarAsTheTimeGoes) {
  const std::vector<std::optional<Nanos>> needed = {
      seconds(40), seconds(3), {}, seconds(20), seconds(5)};
  EXPECT_THAT(chosen(needed, seconds(28)), ElementsAre(1, 3, 4));
  EXPECT_THAT(chosen(needed, seconds(27)), ElementsAre(1, 4));
  EXPECT_THAT(chosen(needed, seconds(68)), ElementsAre(0, 1, 3, 4));
}

TEST(PrecisionPlan, TakesAllIfNoneCanBecomePrecise) {
  EXPECT_THAT(chosen({seconds(40), {}, seconds(30)}, seconds(29)), ElementsAre(0, 1, 2));
  EXPECT_THAT(chosen({{}, {}}, seconds(29)), ElementsAre(0, 1));
  EXPECT_THAT(chosen({}, seconds(29)), IsEmpty());
}

}  // namespace
}  // namespace pirt
