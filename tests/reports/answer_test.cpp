// Which mode to take, and why.
#include "reports/run/answer.h"

#include <gmock/gmock.h>

#include "scheduler/record/interval.h"
#include "scheduler/record/keeping_up.h"

namespace pirt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::StartsWith;

PipelineResult pipeline(const std::string& name, double p99_ms, double deadline_ms = 40) {
  PipelineResult result;
  result.pipeline = name;
  result.fired = result.completed = 100;
  result.p99_ms = p99_ms;
  result.deadline_ms = deadline_ms;
  result.deadline_misses = 0;
  result.real_time = true;
  return result;
}

RunRecord run(const std::string& mode, double energy_j, double p99_ms) {
  RunRecord record;
  record.mode = mode;
  record.platform = "board";
  record.mix = "robot";
  record.makespan_s = 60;
  record.completed = 100;
  record.energy_j = energy_j;
  record.throughput_per_ms = 1;
  record.pipelines = {pipeline("camera", p99_ms)};
  return record;
}

/// With figures redrawn to these joules.
RunRecord redrawn(RunRecord record, const std::vector<double>& joules) {
  for (const double each : joules) {
    RunRecord other = record;
    other.energy_j = each;
    record.redrawn.push_back(figures_of(other));
  }
  record.intervals = intervals_of(record.redrawn);
  return record;
}

TEST(KeepingUp, OnlyTheFirstFiringsMayBeDropped) {
  RunRecord record = run("edf", 1, 10);
  EXPECT_TRUE(keeps_up(record));
  record.pipelines[0].dropped = record.pipelines[0].no_predecessor.emplace(1);
  EXPECT_TRUE(keeps_up(record));
  record.pipelines[0].dropped = 2;
  EXPECT_FALSE(keeps_up(record));
  EXPECT_EQ(real_time_losses(record), 1);
}

TEST(KeepingUp, LateAndQueuedFiringsCountOfRealTimePipelines) {
  RunRecord record = run("edf", 1, 10);
  record.pipelines[0].deadline_misses = 3;
  record.pipelines[0].queued = 2;
  EXPECT_EQ(shortfall_of(record.pipelines[0]).firings(), 3)
      << "what is late and queued counts once";
  record.pipelines[0].deadline_ms.reset();
  record.pipelines[0].deadline_misses.reset();
  EXPECT_EQ(shortfall_of(record.pipelines[0]).queued, 2);
  record.pipelines[0].real_time = false;
  EXPECT_TRUE(keeps_up(record));
}

TEST(ModeAnswer, TakesTheLeastEnergyOfThoseThatKeepUp) {
  RunRecord late = run("cheap", 1, 50);
  late.pipelines[0].deadline_misses = 4;
  const ModeAnswer answer = answer_of({.runs = {run("edf", 3, 10), run("energy", 2, 30), late}});
  EXPECT_THAT(answer.modes, ElementsAre("energy"));
  EXPECT_THAT(answer.sentence, StartsWith("Take energy: of 3 modes 2 keep up"));
  EXPECT_THAT(answer.doubts, IsEmpty());
}

TEST(ModeAnswer, RanksByTheTailWhereEnergyIsNotKnownOfAll) {
  RunRecord dark = run("edf", 3, 10);
  dark.energy_j.reset();
  const ModeAnswer answer = answer_of({.runs = {dark, run("energy", 2, 30)}});
  EXPECT_THAT(answer.modes, ElementsAre("edf"));
  EXPECT_THAT(answer.sentence, HasSubstr("least p99 / deadline, 0.250"));
}

TEST(ModeAnswer, NamesAllThatCannotBeToldApart) {
  const auto a = redrawn(run("a", 2, 10), {1.9, 2.0, 2.1});
  const auto b = redrawn(run("b", 2.05, 10), {2.0, 1.95, 2.15});  // less in one of three
  const auto c = redrawn(run("c", 2.5, 10), {2.4, 2.5, 2.6});     // more in each
  const ModeAnswer answer = answer_of({.runs = {a, b, c}});
  EXPECT_THAT(answer.modes, ElementsAre("a", "b"));
  EXPECT_THAT(answer.sentence, HasSubstr("a or b"));
  EXPECT_THAT(answer.sentence, HasSubstr("~2.00 (1.90 to 2.10) J"));
  const ModeAnswer other_order = answer_of({.runs = {b, a, c}});
  EXPECT_THAT(other_order.modes, ElementsAre("a", "b")) << "the best first, not the first listed";
  EXPECT_THAT(other_order.sentence, HasSubstr("~2.00 (1.90 to 2.10) J"));
}

TEST(ModeAnswer, IfNoneKeepsUpTheFewestLosses) {
  RunRecord a = run("a", 1, 50), b = run("b", 9, 50);
  a.pipelines[0].deadline_misses = 40;
  b.pipelines[0].deadline_misses = 7;
  b.pipelines[0].dropped = 1;
  const ModeAnswer answer = answer_of({.runs = {a, b}});
  EXPECT_EQ(
      answer.sentence,
      "No mode keeps up. Take b: with 8 real-time firings late or dropped, it loses the fewest.");
  RunRecord idle = run("idle", 0, 50);
  idle.stalled = 3;
  EXPECT_FALSE(keeps_up(idle));
  EXPECT_THAT(answer_of({.runs = {idle, a, b}}).modes, ElementsAre("b"));
  EXPECT_EQ(answer_of({.runs = {idle}}).sentence,
            "idle does not keep up: 0 real-time firings late or dropped, 3 tasks never begun.");
  // Without deadlines what counts is how many wait for ever.
  for (RunRecord* each : {&a, &b}) {
    each->pipelines[0].deadline_ms.reset();
    each->pipelines[0].deadline_misses.reset();
    each->pipelines[0].dropped = 0;
  }
  a.pipelines[0].queued = 30;
  b.pipelines[0].queued = 400;
  EXPECT_EQ(answer_of({.runs = {a, b}}).sentence,
            "No mode keeps up. Take a: with 0 real-time firings late or dropped and 30 queued, it "
            "loses the fewest.");
}

TEST(ModeAnswer, ChoosesNoneOfOne) {
  EXPECT_THAT(answer_of({.runs = {run("edf", 3, 10)}}).sentence,
              StartsWith("edf keeps up, with ~3.00 J in "));
  RunRecord late = run("edf", 3, 50);
  late.pipelines[0].deadline_misses = 4;
  EXPECT_EQ(answer_of({.runs = {late}}).sentence,
            "edf does not keep up: 4 real-time firings late or dropped.");
}

TEST(ModeAnswer, SaysWhatIsUncertain) {
  RunRecord record = run("a", 1, 10);
  record.figures = 62;
  for (int i = 0; i < 9; ++i) {
    record.doubted.push_back({.workload = "sobel",
                              .unit = "cpu",
                              .doubts = {"contended"},
                              .low = 0.5,
                              .high = 1.1,
                              .taken = 0.31,
                              .wild = {}});
  }
  EXPECT_THAT(
      answer_of({.runs = {record}}).doubts,
      StartsWith("9 of 62 figures are uncertain (contended): other programs took up to 31 % "
                 "of the time of cpu"));
}

TEST(ModeAnswer, SaysWhyNothingRan) {
  const ModeAnswer answer = answer_of(
      {.runs = {}, .skipped = {{"edf", "no unit serves sobel"}, {"ect", "no unit serves sobel"}}});
  EXPECT_EQ(answer.sentence, "No mode could run: edf, ect: no unit serves sobel");
  EXPECT_THAT(answer.modes, IsEmpty());
}

TEST(ModeAnswer, ItsTablesHaveSixColumnsAtMost) {
  std::vector<RunRecord> runs;
  for (const char* mode : {"a", "b", "c", "d", "e", "f", "g"}) runs.push_back(run(mode, 1, 10));
  runs[1].pipelines[0].deadline_misses = 3;
  const auto tables = answer_tables(runs);
  ASSERT_THAT(tables, SizeIs(2));
  EXPECT_THAT(tables[0].columns, SizeIs(6));
  EXPECT_THAT(tables[1].columns, SizeIs(3));
  EXPECT_THAT(tables[0].rows[0], ElementsAre("keeps up", "yes", "✗ no", "yes", "yes", "yes"));
  EXPECT_EQ(tables[0].rows.back()[0], "camera, p99 of 40.0 ms");
  EXPECT_EQ(tables[0].rows.back()[2], "✗ ~10.0, 3 late");
}

TEST(ModeAnswer, ComparesTailsPipelineByPipelineWithoutDeadlines) {
  RunRecord a = run("a", 1, 17.6), b = run("b", 2, 10.4);
  for (RunRecord* each : {&a, &b}) {
    each->pipelines[0].deadline_ms.reset();
    each->pipelines[0].deadline_misses.reset();
  }
  const std::vector<RunRecord> runs = {a, b};
  EXPECT_NEAR(*tail_of(runs[0], runs), 17.6 / 10.4, 1e-12);
  EXPECT_EQ(tail_of(runs[1], runs), 1);
  EXPECT_EQ(tail_name(runs), "p99 from firing to completion");
}

}  // namespace
}  // namespace pirt
