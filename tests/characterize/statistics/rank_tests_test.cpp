#include "characterize/statistics/rank_tests.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace pirt {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;

TEST(Holm, MultipliesByHowManyAreLeftAndNeverFalls) {
  // Sorted 0.005 0.01 0.03 0.04: times 4, 3, 2, 1 = 0.02 0.03 0.06 0.04; the last is raised.
  EXPECT_THAT(holm_adjusted(std::vector<double>{0.01, 0.04, 0.03, 0.005}),
              ElementsAre(DoubleNear(0.03, 1e-12), DoubleNear(0.06, 1e-12), DoubleNear(0.06, 1e-12),
                          DoubleNear(0.02, 1e-12)));
  EXPECT_THAT(holm_adjusted(std::vector<double>{0.6, 0.7}), ElementsAre(1, 1));
  EXPECT_TRUE(holm_adjusted({}).empty());
}

TEST(SignTest, CountsThoseOnOneSideOfTheLimit) {
  // 8 of 8 above: 1/256. 7 of 8: 9/256. Equal ones are not above.
  const std::vector<double> values = {1, 2, 3, 4, 5, 6, 7, 8};
  EXPECT_NEAR(sign_test_p(values, 0), 1.0 / 256, 1e-12);
  EXPECT_NEAR(sign_test_p(values, 1), 9.0 / 256, 1e-12);
  EXPECT_EQ(sign_test_p(values, 9), 1);
  EXPECT_EQ(sign_test_p({}, 0), 1);
  EXPECT_NEAR(sign_test_p_below(values, 9), 1.0 / 256, 1e-12);
  EXPECT_NEAR(sign_test_p_below(values, 8), 9.0 / 256, 1e-12);
  EXPECT_EQ(sign_test_p_below(values, 0), 1);
  EXPECT_EQ(sign_test_p_below({}, 0), 1);
}

TEST(MedianBound, IsTheOrderStatisticThatConfidenceAllows) {
  std::vector<double> values(12);
  std::iota(values.begin(), values.end(), 1);
  // P(Bin(12, 1/2) >= 11) = 13/4096 = 0.32 %, >= 10: 79/4096 = 1.9 %. So 99.5 %: the 2nd smallest.
  EXPECT_EQ(median_lower_bound(values, 0.995), 2);
  EXPECT_EQ(median_upper_bound(values, 0.995), 11);
  EXPECT_EQ(median_lower_bound(values, 0.98), 3);
  // 7 values: 1/128 = 0.8 % is above 0.5 %; 8: 1/256.
  EXPECT_FALSE(median_lower_bound(std::span(values).first(7), 0.995));
  EXPECT_EQ(median_lower_bound(std::span(values).first(8), 0.995), 1);
  EXPECT_FALSE(median_lower_bound({}, 0.95));
}

TEST(MedianOf, TakesTheMiddle) {
  EXPECT_EQ(median_of(std::vector<double>{3, 1, 2}), 2);
  EXPECT_EQ(median_of(std::vector<double>{4, 1, 3, 2}), 2.5);
}

}  // namespace
}  // namespace pirt
