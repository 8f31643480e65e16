// What the gate says of two programs: verdicts, their correction, flips, and the self-test's rates.
#include "reports/gate/duet_gate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>

#include "reports/gate/self_test.h"
#include "tests/support/errors.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

using testing::HasSubstr;

const std::vector<DuetCell> kCells = {{"sobel", "cpu"}, {"sobel", "gpu"}};

/// Steady programs: seconds of `call` by side and cell.
TakeSample calls(std::map<std::pair<Side, std::string>, double> seconds) {
  return [=](Side side, const DuetCell& cell, SampleKind, Nanos) {
    Sample sample;
    sample.device = "CPU";
    sample.right = true;
    sample.seconds = {{"call", seconds.at({side, cell.unit})}};
    return SampleOutcome{.sample = sample, .error = {}};
  };
}

GateResult judged(const TakeSample& take, const DuetLimits& limits = {}) {
  DuetComparison comparison(kCells, 1);
  Ledger nowhere;
  const auto end = run_duet(comparison, nowhere, take, one_at_a_time(kCells.size()), limits);
  return judge_duet(comparison, end);
}

GateReport report_of(GateResult result) {
  GateReport report{
      .base = "old", .candidate = "new", .result = std::move(result), .decisions = {}, .rule = {}};
  describe_rule(report);
  return report;
}

constexpr Side kA = Side::kBaseline, kB = Side::kCandidate;

TEST(DuetGate, SaysWhichPhaseOfWhichCellBecameSlowerAndWhatFlipped) {
  const auto result = judged(calls(
      {{{kA, "cpu"}, 1e-3}, {{kB, "cpu"}, 1.5e-3}, {{kA, "gpu"}, 1.2e-3}, {{kB, "gpu"}, 1.0e-3}}));
  ASSERT_EQ(result.rows.size(), 2U);
  EXPECT_EQ(result.rows[0].verdict, GateVerdict::kSlower);
  EXPECT_NEAR(*result.rows[0].ratio, 1.5, 1e-9);
  EXPECT_NEAR(*result.rows[0].base, 1e6, 1);
  EXPECT_LT(*result.rows[0].p, 0.001);
  EXPECT_EQ(result.rows[1].verdict, GateVerdict::kFaster);
  EXPECT_EQ(exit_code_of(result), 1);
  const auto flips = find_flips(result);
  ASSERT_EQ(flips.size(), 1U);
  EXPECT_EQ(flips[0].base, "cpu");
  EXPECT_EQ(flips[0].candidate, "gpu");
  EXPECT_TRUE(flips[0].clear);
  const auto report = report_of(result);
  EXPECT_THAT(render(gate_document(report, false), Format::kMarkdown),
              testing::AllOf(HasSubstr("REGRESSION"), HasSubstr("+50.0"), HasSubstr("ABBA")));
  EXPECT_THAT(gate_junit(report), HasSubstr("failures=\"1\""));
  EXPECT_EQ(gate_json(report)["exit_code"], 1);
}

TEST(DuetGate, EqualProgramsPass) {
  const auto result = judged(
      calls({{{kA, "cpu"}, 1e-3}, {{kB, "cpu"}, 1e-3}, {{kA, "gpu"}, 1e-3}, {{kB, "gpu"}, 1e-3}}));
  EXPECT_EQ(exit_code_of(result), 0);
  EXPECT_EQ(result.count(GateVerdict::kSame), 2);
  EXPECT_TRUE(find_flips(result).empty());
}

TEST(DuetGate, AFailureOfTheCandidateFailsAndOfTheBaselineIsNotComparable) {
  const auto failing = [](Side which) {
    return [=](Side side, const DuetCell& cell, SampleKind kind, Nanos most) {
      if (side == which && cell.unit == "gpu") {
        return SampleOutcome{.sample = {}, .error = "timed out after 60 s"};
      }
      return calls(
          {{{kA, "cpu"}, 1e-3}, {{kB, "cpu"}, 1e-3}, {{kA, "gpu"}, 1e-3}, {{kB, "gpu"}, 1e-3}})(
          side, cell, kind, most);
    };
  };
  const auto of_candidate = judged(failing(kB));
  EXPECT_EQ(of_candidate.count(GateVerdict::kFailed), 1);
  EXPECT_EQ(exit_code_of(of_candidate), 1);
  EXPECT_THAT(gate_junit(report_of(of_candidate)), HasSubstr("timed out after 60 s"));
  const auto of_baseline = judged(failing(kA));
  EXPECT_EQ(of_baseline.count(GateVerdict::kNotComparable), 1);
  EXPECT_EQ(exit_code_of(of_baseline), kExitInconclusive);
}

TEST(DuetGate, AFigureThatTheFirstProcessesDoNotAllHaveIsNamedAndNotJudged) {
  DuetComparison comparison({{std::string(kCommandCell), ""}}, 1);
  Ledger nowhere;
  int processes = 0;
  const auto take = [&processes](Side side, const DuetCell&, SampleKind, Nanos) {
    Sample sample;
    sample.seconds = {{"time", 1.0}};
    if (++processes > 2) sample.seconds["rate"] = side == kA ? 100 : 50;
    if (processes > 2) sample.measures = {{"rate", {"MB/s", true}}};
    return SampleOutcome{.sample = sample, .error = {}};
  };
  const auto end = run_duet(comparison, nowhere, take, one_at_a_time(1), {});
  const auto result = judge_duet(comparison, end);
  ASSERT_EQ(result.rows.size(), 2U);
  EXPECT_EQ(result.rows[1].phase, "rate");
  EXPECT_EQ(result.rows[1].verdict, GateVerdict::kNotJudged);
  EXPECT_THAT(result.rows[1].reason, HasSubstr("each of the first processes"));
}

/// Of two commands of the same rate, whose runs of each of @p sides print 0 where @p prints_0 says
/// so of their number, from 1 on.
GateRow rate_of(const std::vector<Side>& sides, const std::function<bool(int)>& prints_0) {
  DuetComparison comparison({{std::string(kCommandCell), ""}}, 1);
  Ledger nowhere;
  std::map<Side, int> runs;
  const auto take = [&](Side of, const DuetCell&, SampleKind, Nanos) {
    Sample sample;
    const bool is_0 = std::ranges::count(sides, of) > 0 && prints_0(++runs[of]);
    sample.seconds = {{"time", 1.0}, {"rate", is_0 ? 0.0 : 100.0}};
    sample.measures = {{"rate", {"MB/s", true}}};
    return SampleOutcome{.sample = sample, .error = {}};
  };
  const auto end = run_duet(comparison, nowhere, take, one_at_a_time(1), {});
  const GateResult result = judge_duet(comparison, end);
  return *std::ranges::find(result.rows, "rate", &GateRow::phase);
}

TEST(DuetGate, AFigureThatTheCandidateHasNotAsOftenIsInconclusive) {
  // Two a block from the second on; 5 of 26 are more than chance.
  const auto at_times = [](int run) { return run % 5 == 0; };
  const GateRow lost = rate_of({kB}, at_times);
  EXPECT_EQ(lost.verdict, GateVerdict::kInconclusive);
  EXPECT_THAT(
      lost.reason,
      HasSubstr(
          "5 of the candidate's runs lacked the figure, or a 0 that is the best there is, 0 of"));
  EXPECT_EQ(rate_of({kA}, at_times).verdict, GateVerdict::kSame);
  const GateRow once = rate_of({kB}, [](int run) { return run == 9; });
  EXPECT_EQ(once.verdict, GateVerdict::kSame) << "that may be chance";
  EXPECT_THAT(once.reason, HasSubstr("1 of the candidate's runs"));
  // The first runs that count are the second and the third.
  const auto at_first = [](int run) { return run == 2; };
  const GateRow passing = rate_of({kB}, at_first);
  EXPECT_EQ(passing.verdict, GateVerdict::kInconclusive);
  EXPECT_THAT(passing.reason, HasSubstr("1 of the candidate's runs"));
  EXPECT_EQ(rate_of({kA}, at_first).verdict, GateVerdict::kNotJudged);
}

TEST(DuetGate, APhaseThatTheFirstProcessesDoNotAllHaveIsNamed) {
  const auto rows_without = [](Side lacks) {
    DuetComparison comparison({kCells[0]}, 1);
    Ledger nowhere;
    std::map<Side, int> runs;
    const auto take = [&](Side of, const DuetCell&, SampleKind, Nanos) {
      Sample sample;
      sample.seconds = {{"call", 1e-3}, {"execute", 1e-3}, {"launch", 5e-4}};
      // The first run that counts is the second.
      if (++runs[of] == 2 && of == lacks) sample.seconds = {{"call", 1e-3}};
      return SampleOutcome{.sample = sample, .error = {}};
    };
    const auto end = run_duet(comparison, nowhere, take, one_at_a_time(1), {});
    return judge_duet(comparison, end).rows;
  };
  const auto rows = rows_without(kB);
  ASSERT_EQ(rows.size(), 2U) << "a part of a call is seen in the call";
  EXPECT_EQ(rows[0].phase, "call");
  EXPECT_EQ(rows[0].verdict, GateVerdict::kSame);
  EXPECT_EQ(rows[1].phase, "execute");
  EXPECT_EQ(rows[1].verdict, GateVerdict::kInconclusive);
  EXPECT_THAT(rows[1].reason, HasSubstr("1 of the candidate's runs"));
  EXPECT_EQ(rows_without(kA).at(1).verdict, GateVerdict::kNotJudged);
}

TEST(DuetGate, AFigureThatBothLackOftenIsNotCalledNoisy) {
  const GateRow row = rate_of({kA, kB}, [](int run) { return run > 3 && run % 3 == 0; });
  EXPECT_EQ(row.verdict, GateVerdict::kInconclusive);
  EXPECT_EQ(row.reason, "it was missing, or 0, in 8 of 13 blocks");
}

TEST(DuetGate, WhatTimeDidNotAllowIsInconclusive) {
  const auto result = judged(calls({}), {.time = Nanos(0)});
  EXPECT_EQ(exit_code_of(result), kExitInconclusive);
  EXPECT_THAT(result.rows[0].reason, HasSubstr("time was up"));
}

TEST(SelfTest, CountsDecisionsAndBoundsTheirRates) {
  SelfTest test;
  const Trial& same = find_trial("same");
  const Trial& slowed = find_trial("execute +10 %");
  for (int i = 0; i < 299; ++i) test.apply(SelfTest::event_of(same, TrialAnswer::kRight, 2, ""));
  test.apply(SelfTest::event_of(slowed, TrialAnswer::kRight, 1, ""));
  test.apply(SelfTest::event_of(slowed, TrialAnswer::kInconclusive, 1, "noise"));
  EXPECT_EQ(test.count(same).decisions(), 299);
  EXPECT_EQ(test.count(same).misses(same), 0);
  EXPECT_EQ(test.count(slowed).misses(slowed), 1) << "an inconclusive is a miss";
  EXPECT_FALSE(breaks_promise(test)) << "1 of 2 may be chance";
  for (int i = 0; i < 3; ++i) test.apply(SelfTest::event_of(slowed, TrialAnswer::kWrong, 1, ""));
  EXPECT_TRUE(breaks_promise(test));
  EXPECT_THAT(render(self_test_document(test), Format::kText), HasSubstr("299"));
  EXPECT_EQ(self_test_json(test)["trials"].size(), 2U);
}

TEST(SelfTest, RefusesOtherEvents) {
  SelfTest test;
  for (const char* bad : {R"({})", R"({"decision": {"trial": "sam", "answer": "right"}})",
                          R"({"decision": {"trial": "same", "answer": "maybe"}})"}) {
    test::bad_input([&] { test.apply(parse_json(bad)); });
  }
}

TEST(SelfTest, AnswersByTheInjectedPhase) {
  const Trial& slowed = find_trial("prepare +20 %");
  GateResult result;
  result.rows = {{.workload = "sobel",
                  .unit = "cpu",
                  .phase = "prepare",
                  .verdict = GateVerdict::kInconclusive,
                  .reason = {}},
                 {.workload = "sobel",
                  .unit = "cpu",
                  .phase = "execute",
                  .verdict = GateVerdict::kSlower,
                  .reason = {}}};
  EXPECT_EQ(answer_of(slowed, result, {"sobel", "cpu"}), TrialAnswer::kInconclusive);
  result.rows[0].verdict = GateVerdict::kSlower;
  EXPECT_EQ(answer_of(slowed, result, {"sobel", "cpu"}), TrialAnswer::kRight);
  EXPECT_EQ(answer_of(slowed, result, {"conv1", "cpu"}), TrialAnswer::kWrong);
  EXPECT_EQ(answer_of(find_trial("same"), result, {"sobel", "cpu"}), TrialAnswer::kWrong);
}

}  // namespace
}  // namespace pirt
