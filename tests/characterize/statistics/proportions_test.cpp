#include "characterize/statistics/proportions.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pirt {
namespace {

TEST(Proportions, BoundsAreThoseOfClopperAndPearson) {
  EXPECT_NEAR(rate_upper_bound(0, 299), 0.00997, 1e-5);  // 1 - 0.05^(1/299)
  EXPECT_NEAR(rate_upper_bound(0, 59), 0.0495, 1e-4);
  EXPECT_NEAR(rate_upper_bound(2, 124), 0.0499, 2e-4);
  EXPECT_EQ(rate_upper_bound(3, 3), 1);
  EXPECT_EQ(rate_lower_bound(0, 3), 0);
  EXPECT_NEAR(rate_lower_bound(3, 3), 0.3684, 1e-4);  // 0.05^(1/3)
}

TEST(Proportions, AtMostSoManyAreAsLikelyAsTheBinomialHasIt) {
  EXPECT_NEAR(binomial_cdf(1, 8, 0.5), 9.0 / 256, 1e-12);
  EXPECT_NEAR(binomial_cdf(0, 3, 0.2), 0.512, 1e-12);
  EXPECT_EQ(binomial_cdf(-1, 3, 0.2), 0);
  EXPECT_EQ(binomial_cdf(3, 3, 0.2), 1);
}

TEST(Proportions, FishersTestIsExact) {
  // The tea: 3 of 4 against 1 of 4: (16 + 1) of C(8, 4) = 70.
  EXPECT_NEAR(fisher_p(1, 4, 3, 4), 17.0 / 70, 1e-12);
  EXPECT_NEAR(fisher_p(0, 4, 4, 4), 1.0 / 70, 1e-12);
  EXPECT_NEAR(fisher_p(4, 4, 0, 4), 1, 1e-12);
  EXPECT_NEAR(fisher_p(0, 300, 0, 300), 1, 1e-12);
  EXPECT_LT(fisher_p(0, 300, 12, 300), 1e-3);
}

}  // namespace
}  // namespace pirt
