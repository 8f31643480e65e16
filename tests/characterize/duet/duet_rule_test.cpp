// The sequential rule: each way to a verdict, and simulated rates of false alarms and misses.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "characterize/duet/rule.h"
#include "workloads/base/math/random.h"

namespace pirt {
namespace {

void add(DuetRule& rule, int blocks, double log_ratio) {
  for (int i = 0; i < blocks; ++i) rule.add_block(log_ratio);
}

TEST(DuetRule, ClearsEqualProgramsAtTheFirstLook) {
  DuetRule rule;
  add(rule, 7, 0.001);
  EXPECT_EQ(rule.verdict(), DuetVerdict::kUndecided);
  rule.add_block(0.001);  // 8 of 8 below 4 %: the 99.5 % upper bound is.
  EXPECT_EQ(rule.verdict(), DuetVerdict::kNotSlower);
  EXPECT_EQ(rule.p_value(), 1);
}

TEST(DuetRule, SuspectsNotBeforeTwelveBlocksAndConfirmsOnFreshOnes) {
  DuetRule rule;
  add(rule, 11, 0.10);
  EXPECT_FALSE(rule.confirming());
  rule.add_block(0.10);
  EXPECT_TRUE(rule.confirming());
  EXPECT_EQ(rule.verdict(), DuetVerdict::kUndecided);
  add(rule, 19, 0.10);
  EXPECT_EQ(rule.verdict(), DuetVerdict::kUndecided);
  rule.add_block(0.10);
  EXPECT_EQ(rule.verdict(), DuetVerdict::kSlower);
  EXPECT_NEAR(rule.effect(), 0.10, 1e-12);
  EXPECT_NEAR(rule.p_value(), std::pow(0.5, 20), 1e-15);
  rule.add_block(-1);
  EXPECT_EQ(rule.confirmation().size(), 20U) << "nothing is added after a verdict";
}

TEST(DuetRule, DropsASuspicionThatFreshBlocksDoNotBear) {
  DuetRule rule;
  add(rule, 12, 0.10);
  add(rule, 20, 0.005);
  EXPECT_EQ(rule.verdict(), DuetVerdict::kNotSlower);
}

TEST(DuetRule, GivesUpOnWhatIsTooSmallToFind) {
  // Half the blocks at -5 % and half at +6 %: no bound clears it, the median is below 2 %.
  DuetRule rule;
  for (int i = 0; i < 10; ++i) {
    rule.add_block(-0.05);
    rule.add_block(0.06);
    if (i == 5) {
      EXPECT_EQ(rule.verdict(), DuetVerdict::kUndecided);
    }
  }
  EXPECT_EQ(rule.verdict(), DuetVerdict::kNotSlower);
  EXPECT_EQ(rule.blocks().size(), 20U);
}

TEST(DuetRule, LeavesTheQuestionOpenAtTheLastLook) {
  // Half at -24 % and half at 30 %: median 3 %, too little to suspect, and a bound beyond 10 %.
  DuetRule rule;
  for (int i = 0; i < 90; ++i) rule.add_block(i % 2 == 0 ? -0.24 : 0.30);
  EXPECT_EQ(rule.verdict(), DuetVerdict::kInconclusive);
  EXPECT_EQ(rule.blocks().size(), 90U);
}

TEST(DuetRule, EightPercentThatNoBoundShowsAreNoPass) {
  // 50 of 90 at 8 %, 40 at 1.5 %: the lower bound never is above 2 %, the upper one never 10 %.
  DuetRule rule;
  for (int i = 0; i < 90; ++i) rule.add_block(i % 9 < 5 ? 0.077 : 0.015);
  EXPECT_EQ(rule.blocks().size(), 90U) << "and no suspicion";
  EXPECT_EQ(rule.verdict(), DuetVerdict::kInconclusive);
}

TEST(DuetRule, IsInconclusiveOnceItIsGivenUp) {
  DuetRule open;
  add(open, 3, 0.10);
  open.give_up();
  EXPECT_EQ(open.verdict(), DuetVerdict::kInconclusive);
  DuetRule decided;
  add(decided, 8, 0);
  decided.give_up();
  EXPECT_EQ(decided.verdict(), DuetVerdict::kNotSlower);
}

TEST(DuetRule, SetUpAsksForTwiceTheEffect) {
  DuetRule call;
  DuetRule setup(setup_thresholds());
  add(call, 12, 0.07);
  add(setup, 8, 0.07);
  EXPECT_TRUE(call.confirming());
  EXPECT_EQ(setup.verdict(), DuetVerdict::kNotSlower);
  DuetRule slower(setup_thresholds());
  add(slower, 12, std::log(1.2));
  EXPECT_TRUE(slower.confirming());
}

TEST(DuetRule, AmongManySeriesAConfirmationTakesMoreBlocks) {
  // 16 of 20 up: p 0.006, enough alone and not among 100.
  const auto confirm = [](DuetRule& rule, int blocks, std::size_t table) {
    for (int i = 0; i < blocks; ++i) rule.add_block(i % 5 == 0 ? -0.02 : 0.10, table);
  };
  DuetRule alone;
  add(alone, 12, 0.10);
  confirm(alone, 20, 1);
  EXPECT_EQ(alone.verdict(), DuetVerdict::kSlower);
  DuetRule among_many;
  add(among_many, 12, 0.10);
  confirm(among_many, 20, 100);
  EXPECT_EQ(among_many.verdict(), DuetVerdict::kUndecided);
  confirm(among_many, 20, 100);
  EXPECT_EQ(among_many.verdict(), DuetVerdict::kSlower);
  EXPECT_LT(among_many.p_value(), 0.05 / 100);
}

TEST(DuetRule, RefusesWhereTheBaselineDiffersFromItself) {
  DuetRule rule;
  for (const double canary : {0.03, 0.04, 0.03, 0.02, 0.05, 0.03, 0.06, 0.01}) {
    rule.add_canary(canary);
  }
  add(rule, 12, 0.10);
  add(rule, 20, 0.10);
  EXPECT_EQ(rule.verdict(), DuetVerdict::kRefused);
  DuetRule other_way;
  for (int i = 0; i < 8; ++i) other_way.add_canary(-0.03);
  add(other_way, 8, 0);
  EXPECT_EQ(other_way.verdict(), DuetVerdict::kRefused);
  // Seven cannot say so at 1 %, and a median within 2 % is none to speak of.
  DuetRule few;
  for (int i = 0; i < 7; ++i) few.add_canary(0.03);
  add(few, 8, 0);
  EXPECT_EQ(few.verdict(), DuetVerdict::kNotSlower);
  DuetRule small;
  for (int i = 0; i < 20; ++i) small.add_canary(0.01);
  add(small, 8, 0);
  EXPECT_EQ(small.verdict(), DuetVerdict::kNotSlower);
}

TEST(DuetRule, NoisyCanariesAroundNothingDoNotRefuse) {
  // Median 3 %, but spread over both sides: the blocks are as noisy, and the rule knows.
  DuetRule rule;
  for (const double canary : {0.10, -0.08, 0.03, 0.12, 0.09, 0.05, 0.04, 0.03, 0.02}) {
    rule.add_canary(canary);
  }
  add(rule, 20, 0);
  EXPECT_EQ(rule.verdict(), DuetVerdict::kNotSlower);
}

/// Blocks as a shared machine has them: noise, a spike now and then that hits either side.
class Machine {
 public:
  Machine(double noise, std::uint64_t seed) : noise_(noise), random_(seed) {}
  double block(double slowdown) {
    double value = slowdown + noise_ * normal();
    if (random_.next() % 20 == 0) value += 0.5 * (uniform() - 0.5);
    return value;
  }

 private:
  double uniform() { return (static_cast<double>(random_.next() >> 11) + 0.5) * 0x1p-53; }
  double normal() {
    return std::sqrt(-2 * std::log(uniform())) * std::cos(2 * std::numbers::pi * uniform());
  }
  double noise_;
  Random random_;
};

struct Rates {
  int slower = 0, not_slower = 0, inconclusive = 0, refused = 0;
};

Rates simulate(const DuetThresholds& thresholds, double noise, double slowdown, int trials) {
  constexpr std::size_t kTable = 8;
  Rates rates;
  for (int trial = 0; trial < trials; ++trial) {
    Machine machine(noise, static_cast<std::uint64_t>(trial) + 1);
    DuetRule rule(thresholds);
    while (rule.verdict() == DuetVerdict::kUndecided) {
      if (rule.confirming() && rule.confirmation().size() % 2 == 0) {
        rule.add_canary(machine.block(0));
      }
      rule.add_block(machine.block(slowdown), kTable);
    }
    const bool slower =
        rule.verdict() == DuetVerdict::kSlower && rule.p_value() < thresholds.alpha / kTable;
    rates.slower += slower ? 1 : 0;
    rates.not_slower += rule.verdict() == DuetVerdict::kNotSlower ? 1 : 0;
    rates.inconclusive += rule.verdict() == DuetVerdict::kInconclusive ? 1 : 0;
    rates.refused += rule.verdict() == DuetVerdict::kRefused ? 1 : 0;
  }
  return rates;
}

TEST(DuetRule, RaisesNoFalseAlarmAndFindsTenPercentInSimulation) {
  constexpr int kTrials = 2000;
  const DuetThresholds calls;
  for (const double noise : {0.005, 0.02, 0.05, 0.09}) {
    const Rates same = simulate(calls, noise, 0, kTrials);
    EXPECT_EQ(same.slower, 0) << noise;
    EXPECT_LE(same.refused, kTrials / 100) << noise;
  }
  for (const double noise : {0.005, 0.02, 0.05, 0.09}) {
    EXPECT_GE(simulate(calls, noise, std::log(1.10), kTrials).slower, kTrials * 98 / 100) << noise;
  }
  EXPECT_EQ(simulate(calls, 0.01, std::log(1.10), kTrials).not_slower, 0);
}

TEST(DuetRule, FindsTwentyPercentOfSetUpInSimulation) {
  constexpr int kTrials = 2000;
  for (const double noise : {0.02, 0.07, 0.15}) {
    EXPECT_EQ(simulate(setup_thresholds(), noise, 0, kTrials).slower, 0) << noise;
    EXPECT_GE(simulate(setup_thresholds(), noise, std::log(1.20), kTrials).slower,
              kTrials * 98 / 100)
        << noise;
  }
}

}  // namespace
}  // namespace pirt
