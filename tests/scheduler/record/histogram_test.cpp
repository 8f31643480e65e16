#include "scheduler/record/histogram.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "workloads/base/math/random.h"

namespace pirt::test {
namespace {

TEST(Histogram, HasNoPercentilesOfNothing) {
  const Histogram histogram;
  EXPECT_FALSE(histogram.mean());
  EXPECT_FALSE(histogram.percentile(0.5));
}

TEST(Histogram, IsExactBelow1024Nanoseconds) {
  // Nearest rank of 1..1000: the 0.95-quantile is the 950th.
  Histogram histogram;
  for (int i = 1000; i >= 1; --i) histogram.add(Nanos(i));
  EXPECT_EQ(histogram.percentile(0.95), Nanos(950));
  EXPECT_EQ(histogram.percentile(0.5), Nanos(500));
  EXPECT_EQ(histogram.percentile(1.0), Nanos(1000));
  EXPECT_EQ(histogram.percentile(0.0001), Nanos(1));
  // 500.5, and llround goes away from zero.
  EXPECT_EQ(histogram.mean(), Nanos(501));
}

TEST(Histogram, GivesASingleValueBackExactly) {
  Histogram histogram;
  histogram.add(Nanos(123'456'789));
  EXPECT_EQ(histogram.percentile(0.5), Nanos(123'456'789));
}

TEST(Histogram, IsWithinATenthOfAPercentOfTheSortedValues) {
  // Log-uniform over 1 ns to 10^18 ns. Bound: half a bucket, 1/1024 of its lower bound; observed
  // worst 0.0950 %.
  Random random(7);
  Histogram histogram;
  std::vector<std::int64_t> values;
  for (int i = 0; i < 200'000; ++i) {
    const auto value = static_cast<std::int64_t>(std::pow(10.0, random.uniform(0, 18)));
    values.push_back(value);
    histogram.add(Nanos(value));
  }
  std::ranges::sort(values);
  double worst = 0;
  for (int i = 1; i <= 1000; ++i) {
    const double fraction = i / 1000.0;
    const auto rank =
        static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(values.size())));
    const auto exact = static_cast<double>(values[std::max<std::size_t>(rank, 1) - 1]);
    const auto got = static_cast<double>(histogram.percentile(fraction)->count());
    worst = std::max(worst, std::abs(got - exact) / exact);
  }
  EXPECT_LE(worst, 0.001);
  EXPECT_GT(worst, 0);  // The values do not all fall on middles; a bound of 0 would test nothing.
}

TEST(Histogram, TakesAnotherOnesValues) {
  Histogram all;
  Histogram parts[2];
  for (std::int64_t i = 1; i <= 1000; ++i) {
    all.add(Nanos(i * i));
    parts[i % 3 == 0 ? 0 : 1].add(Nanos(i * i));
  }
  Histogram merged;
  for (const Histogram& part : parts) merged.add(part);
  merged.add(Histogram());
  EXPECT_EQ(merged.count(), all.count());
  EXPECT_EQ(merged.mean(), all.mean());
  for (const double fraction : {0.001, 0.5, 0.99, 1.0}) {
    EXPECT_EQ(merged.percentile(fraction), all.percentile(fraction));
  }
}

}  // namespace
}  // namespace pirt::test
