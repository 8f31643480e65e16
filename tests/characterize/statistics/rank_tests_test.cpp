#include "characterize/statistics/rank_tests.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "workloads/base/math/random.h"

namespace pirt {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;

std::vector<Nanos> samples(const std::vector<int>& values) {
  std::vector<Nanos> result;
  for (const int value : values) result.emplace_back(value);
  return result;
}

/// Counts over all ways to say which of the pooled samples are the candidate's.
double enumerated_p(const std::vector<Nanos>& base, const std::vector<Nanos>& candidate) {
  std::vector<Nanos> all = base;
  all.insert(all.end(), candidate.begin(), candidate.end());
  const auto u_of = [&](const std::vector<char>& of_candidate) {
    double u = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      for (std::size_t j = 0; j < all.size(); ++j) {
        if (of_candidate[i] != 0 && of_candidate[j] == 0 && all[i] > all[j]) u += 1;
      }
    }
    return u;
  };
  std::vector<char> mask(all.size(), 0);
  std::fill(mask.begin() + static_cast<std::ptrdiff_t>(base.size()), mask.end(), 1);
  const double observed = u_of(mask);
  double above = 0;
  double ways = 0;
  std::ranges::sort(mask);
  do {
    ways += 1;
    above += u_of(mask) >= observed ? 1 : 0;
  } while (std::ranges::next_permutation(mask).found);
  return above / ways;
}

TEST(MannWhitney, IsExactForFewSamplesWithoutTies) {
  // Complete separation: 1 of C(6, 3) = 20 orders, 1 of C(18, 9) = 48620.
  EXPECT_DOUBLE_EQ(mann_whitney_p(samples({1, 2, 3}), samples({4, 5, 6})), 1.0 / 20);
  EXPECT_DOUBLE_EQ(mann_whitney_p(samples({1, 2, 3, 4, 5, 6, 7, 8, 9}),
                                  samples({11, 12, 13, 14, 15, 16, 17, 18, 19})),
                   1.0 / 48620);
  EXPECT_DOUBLE_EQ(mann_whitney_p(samples({4, 5, 6}), samples({1, 2, 3})), 1);
  Random random(7);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<Nanos> base;
    std::vector<Nanos> candidate;
    for (std::uint64_t i = 0; i < 3 + random.next() % 4; ++i)
      base.emplace_back(static_cast<std::int64_t>(random.next() % 1'000'000));
    for (std::uint64_t i = 0; i < 3 + random.next() % 4; ++i)
      candidate.emplace_back(static_cast<std::int64_t>(random.next() % 1'000'000));
    EXPECT_NEAR(mann_whitney_p(base, candidate), enumerated_p(base, candidate), 1e-12);
  }
}

TEST(MannWhitney, ApproximatesManySamplesAndTies) {
  // 21 x 20 pairs are more than are counted; the exact value of 20 x 20 is near.
  std::vector<Nanos> base;
  std::vector<Nanos> candidate;
  for (int i = 0; i < 20; ++i) base.emplace_back(10 * i);
  for (int i = 0; i < 20; ++i) candidate.emplace_back(10 * i + 35);
  const double exact = mann_whitney_p(base, candidate);
  base.emplace_back(95);
  candidate.emplace_back(131);
  EXPECT_NEAR(mann_whitney_p(base, candidate), exact, 0.02);
  // By hand, 1 1 2 against 1 2 2: U = 2 halves for the 1, 2 + 1 half for each 2 = 6; ties 24 + 24;
  // variance 9/12 * (7 - 48/30) = 4.05; z = (6 - 4.5 - 0.5) / 2.0125 = 0.4969; p = 0.3096.
  EXPECT_NEAR(mann_whitney_p(samples({1, 1, 2}), samples({1, 2, 2})), 0.3096, 1e-4);
  EXPECT_EQ(mann_whitney_p(samples({5, 5, 5}), samples({5, 5, 5})), 1);
  EXPECT_EQ(mann_whitney_p({}, samples({5})), 1);
}

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
