// Levels of a series: steps by hand, and how often they are found, and found where there are none.
#include "characterize/statistics/change_points.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "workloads/base/math/random.h"

namespace pirt {
namespace {

std::vector<double> levels(const std::vector<std::pair<int, double>>& parts) {
  std::vector<double> values;
  for (const auto& [count, level] : parts) {
    // 1 to either side of the level: a standard deviation of 1.
    for (int i = 0; i < count; ++i) values.push_back(level + (i % 2 == 0 ? 1 : -1));
  }
  return values;
}

TEST(ChangePoints, AreWhereALevelBegins) {
  const auto one = change_points(levels({{20, 0}, {20, 5}}), 0);
  ASSERT_EQ(one.size(), 1U);
  EXPECT_EQ(one[0].at, 20U);
  EXPECT_NEAR(one[0].before, 0, 1e-9);
  EXPECT_NEAR(one[0].after, 5, 1e-9);
  EXPECT_TRUE(one[0].sure);
  const auto back = change_points(levels({{30, 0}, {20, 6}, {30, 0}}), 0);
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(back[0].at, 30U);
  EXPECT_EQ(back[1].at, 50U);
  EXPECT_TRUE(change_points(levels({{60, 0}}), 0).empty());
  EXPECT_TRUE(change_points({}, 0).empty());
}

TEST(ChangePoints, ASpikeIsNone) {
  auto values = levels({{60, 0}});
  values[30] = 20;
  EXPECT_TRUE(change_points(values, 0).empty());
}

TEST(ChangePoints, TheNewestFewAreSuspected) {
  const auto found = change_points(levels({{30, 0}, {3, 8}}), 0);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].at, 30U);
  EXPECT_FALSE(found[0].sure);
  EXPECT_TRUE(change_points(levels({{30, 0}, {5, 8}}), 0)[0].sure);
}

TEST(ChangePoints, WhatRepeatsExactlyHasTheLeastNoise) {
  std::vector<double> values(40, 1.0);
  for (std::size_t i = 20; i < 40; ++i) values[i] = 1.002;
  EXPECT_EQ(change_points(values, 1e-4).size(), 1U);
  EXPECT_TRUE(change_points(values, 2e-3).empty());
}

TEST(ChangePoints, CreepIsARiseWithoutAStepThatExplainsIt) {
  const std::vector<double> merges = {0, 0.044, 0.088, 0.132};  // 4.5 % each
  EXPECT_TRUE(change_points(merges, 0.002).empty());
  EXPECT_NEAR(creep_of(merges, {}, 0.002), 0.132, 1e-9);
  const auto step = levels({{20, 0}, {20, 8}});
  EXPECT_EQ(creep_of(step, change_points(step, 0), 0), 0);
  EXPECT_EQ(creep_of(levels({{40, 0}}), {}, 0), 0);
  EXPECT_EQ(creep_of(std::vector<double>{0, 1, 2}, {}, 0.002), 0) << "too few";
}

/// Normal noise of standard deviation 1 in which a value has @p rho of the one before.
std::vector<double> noise(std::size_t count, double rho, Random& random) {
  const auto uniform = [&random] {
    return (static_cast<double>(random.next() >> 11U) + 0.5) * 0x1p-53;
  };
  std::vector<double> values;
  double last = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double fresh =
        std::sqrt(-2 * std::log(uniform())) * std::cos(2 * std::numbers::pi * uniform());
    last = i == 0 ? fresh : rho * last + std::sqrt(1 - rho * rho) * fresh;
    values.push_back(last);
  }
  return values;
}

// A seeded piece of tests/bench/history.cpp.
TEST(ChangePoints, FindsStepsOfThreeStandardDeviationsAndFewOthers) {
  for (const double rho : {0.0, 0.3}) {
    Random random(1);
    int false_changes = 0, found = 0;
    constexpr int kSeries = 150;
    for (int i = 0; i < kSeries; ++i) {
      for (const auto& change : change_points(noise(100, rho, random), 0)) {
        false_changes += change.sure ? 1 : 0;
      }
      auto values = noise(100, rho, random);
      const std::size_t at = 10 + static_cast<std::size_t>(random.below(80));
      for (std::size_t j = at; j < values.size(); ++j) values[j] += 3;
      for (const auto& change : change_points(values, 0)) {
        found += change.sure && change.at + 2 >= at && change.at <= at + 2 ? 1 : 0;
      }
    }
    EXPECT_LE(false_changes, 15) << rho << ": 1 in 1000 of 15000 points";
    EXPECT_GE(found, kSeries * 95 / 100) << rho;
  }
}

}  // namespace
}  // namespace pirt
