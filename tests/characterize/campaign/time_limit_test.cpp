// What a campaign does with the time that it has: what comes first, what is left out when it is
// over, and going on with that.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>

#include "characterize/campaign/campaign.h"
#include "characterize/profile/store/reader.h"
#include "tests/characterize/campaign/campaign_support.h"
#include "tests/characterize/energy/sysfs_tree.h"
#include "tests/support/paths.h"

namespace pirt {
namespace {

using test::error_of;
using test::row;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::UnorderedElementsAre;

class TimeLimit : public test::Campaign {
 protected:
  /// A run of platform fake, which can be gone on with, on unit gpu.
  CampaignOptions shipped(const std::string& filter = "^pool[25]$") {
    auto o = options({}, filter);
    o.platform_argument = "fake";
    o.platform = load_platform("fake");
    o.units = {"gpu"};
    return o;
  }

  CampaignOptions resumed() {
    auto o = resume_options(folder / "p.db");
    o.program = test::kTestWorker;
    return o;
  }

  /// "pool2 process 1, cold set-up" for each step, whose time is over at the @p at-th of them.
  std::vector<std::string> run(const CampaignOptions& o, std::size_t at = 1'000'000) {
    CampaignPlan plan = plan_campaign(o);
    std::vector<std::string> steps;
    ProgressSink sink;
    sink.progress = [&](const Progress& p) {
      if (p.step != "reference") steps.push_back(p.workload + " " + p.step);
      if (steps.size() == at) plan.max_time = Nanos(0);
    };
    summary = run_campaign(o, plan, sink);
    return steps;
  }

  [[nodiscard]] std::string finished() const {
    return load_profile(folder / "p.db").runs.front().finished;
  }
};

TEST_F(TimeLimit, NothingBeginsAfterIt) {
  auto o = options({{"gpu", ""}});
  o.max_time = Nanos(1);
  const auto steps = run(o);
  EXPECT_THAT(steps, IsEmpty());
  EXPECT_EQ(summary.processes, 0);
  EXPECT_EQ(summary.cells + summary.cells_begun, 0);
  EXPECT_THAT(summary.unmeasured,
              UnorderedElementsAre(CellName{"pool2", "gpu"}, CellName{"pool5", "gpu"}));
  EXPECT_THAT(summary.peaks_left_out, ElementsAre("gpu"));
  EXPECT_FALSE(summary.interrupted);
  EXPECT_FALSE(summary.complete());
}

// Nor does what valid rows need: each cell has its cold process, and none the warm one.
TEST_F(TimeLimit, StoresACellWithOneProcessAsDoubted) {
  const auto steps = run(shipped(), 3);
  EXPECT_THAT(steps, SizeIs(3));  // The third did not begin.
  EXPECT_EQ(summary.processes, 2);
  EXPECT_EQ(summary.cells, 0);
  EXPECT_EQ(summary.cells_begun, 2);
  EXPECT_THAT(summary.unmeasured, IsEmpty());
  const Profile profile = load_profile(folder / "p.db");
  for (const auto* workload : {"pool2", "pool5"}) {
    const PhaseRow& call = row(profile, workload, Phase::kCall);
    EXPECT_TRUE(is_used(call)) << workload;
    EXPECT_THAT(call.doubts, Contains("few_samples"));
    EXPECT_EQ(call.processes, 1);
  }
  EXPECT_EQ(finished(), "");
}

// Sampling it again is what the time was to bring, and there is a figure without it.
TEST_F(TimeLimit, ACellThatWasOnlyToBeSampledAgainIsComplete) {
  // As in Rounds.SampleAgainWhatIsUnstableAndThenSaySo.
  std::string samples = "samples_ms: {pool5: [";
  for (int i = 0; i < 60; ++i) samples += "1, ";
  for (int i = 0; i < 2000; ++i) samples += "2, ";
  const auto o = options({{"gpu", samples + "2]}"}}, "^pool5$");
  const auto steps = run(o, 6);
  EXPECT_THAT(steps.back(), HasSubstr("again (unstable)"));
  EXPECT_EQ(summary.cells, 1);
  EXPECT_TRUE(summary.complete());
  EXPECT_THAT(row(load_profile(o.database), "pool5", Phase::kCall).doubts, ElementsAre("unstable"));
}

TEST_F(TimeLimit, GoesOnWithWhatItDidNotSufficeFor) {
  run(shipped(), 2);  // One cell has a process, the other none.
  EXPECT_EQ(summary.cells_begun, 1);
  EXPECT_THAT(summary.unmeasured, SizeIs(1));
  run(resumed());
  EXPECT_TRUE(summary.complete());
  EXPECT_EQ(summary.cells, 2);
  EXPECT_EQ(summary.processes, 7);
  EXPECT_NE(finished(), "");
  for (const PhaseRow& each : load_profile(folder / "p.db").phases) {
    EXPECT_TRUE(is_valid(each)) << each.workload << " " << to_string(each.phase);
  }
}

TEST_F(TimeLimit, CountsWhatWasSpentBefore) {
  std::atomic<bool> stop = false;
  auto o = shipped("^pool5$");
  o.stop = &stop;
  CampaignPlan plan = plan_campaign(o);
  ProgressSink sink;
  sink.progress = [&](const Progress& p) {
    if (p.step.starts_with("process 3")) stop = true;
  };
  run_campaign(o, plan, sink);
  auto rest = resumed();
  EXPECT_GT(rest.resumed->spent, Nanos(0));
  EXPECT_EQ(rest.max_time, plan.max_time);
  rest.resumed->spent = std::chrono::seconds(100);
  plan = plan_campaign(rest);
  EXPECT_GE(plan.spent, std::chrono::seconds(100));
  EXPECT_LE(plan.estimate.total, plan.max_time - std::chrono::seconds(100));
  summary = run_campaign(rest, plan, {});
  EXPECT_TRUE(summary.complete());
  EXPECT_GE(summary.elapsed, std::chrono::seconds(100));
  EXPECT_GE(load_profile(folder / "p.db").runs.front().figure("run.spent_s").value(), 100);
}

TEST_F(TimeLimit, IsToBeRaisedWhereItIsSpent) {
  auto o = shipped("^pool5$");
  o.max_time = Nanos(1);
  run(o);
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return plan_campaign(resumed()); }),
              ::testing::AllOf(HasSubstr("has spent its time"), HasSubstr("--max-time 1min")));
  auto rest = resumed();
  rest.resumed->spent = std::chrono::minutes(10);  // A raised time, which the run does not keep.
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return plan_campaign(rest); }),
              HasSubstr("--max-time 20min"));
  EXPECT_EQ(longer_minutes(std::chrono::seconds(5), std::chrono::seconds(70)), 3)
      << "a first process of 70 s is not given up";
  rest = resumed();
  rest.max_time = std::chrono::minutes(5);
  rest.precision_time.reset();
  run(rest);
  EXPECT_TRUE(summary.complete());
}

TEST_F(TimeLimit, KeepsTheFasterPeaks) {
  run(shipped("^pool5$"), 3);
  auto rest = resumed();
  ASSERT_THAT(rest.resumed->peaks, Not(IsEmpty()));
  PeakRow& known = rest.resumed->peaks.front();  // Of a script without peaks.
  known.per_second = 5e15;
  known.reasons.clear();
  const PeakKind kind = known.kind;
  run(rest);
  EXPECT_EQ(load_profile(folder / "p.db").find_peak("gpu", kind)->per_second, 5e15);
}

// The signal came when all cells were stored, so that the rest has none.
TEST_F(TimeLimit, JudgesThePeaksByCellsOfBefore) {
  std::atomic<bool> stop = false;
  auto o = shipped("^fc8$");
  o.stop = &stop;
  o.unit_times = [&stop](const UnitRecord&) {
    UnitTimePart part;
    part.samples = 2;
    part.measure = [&stop](int) {
      stop = true;
      return std::vector<Nanos>{from_ms(1)};
    };
    return std::vector{part};
  };
  run(o);
  EXPECT_EQ(summary.cells, 1);
  EXPECT_TRUE(summary.interrupted);
  auto rest = resumed();
  const auto known = std::ranges::find(rest.resumed->peaks, PeakKind::kF32, &PeakRow::kind);
  ASSERT_NE(known, rest.resumed->peaks.end());
  known->per_second = 1;
  known->reasons.clear();
  run(rest);
  EXPECT_EQ(summary.cells, 0);
  EXPECT_THAT(load_profile(folder / "p.db").find_peak("gpu", PeakKind::kF32)->reasons,
              ElementsAre("exceeded by fc8"));
}

TEST_F(TimeLimit, WhatTheMixNeedsComesFirstAndAllOnceBeforeAnyTwice) {
  auto o = options({{"gpu", ""}}, "^pool");
  o.first = {{"pool5", {}}, {"sobel", {}}};
  const auto steps = run(o);
  ASSERT_EQ(steps.size(), 12U);
  EXPECT_EQ(steps[0], "pool5 process 1, cold set-up");
  EXPECT_THAT(std::vector(steps.begin(), steps.begin() + 3),
              UnorderedElementsAre(HasSubstr("pool1 process 1"), HasSubstr("pool2 process 1"),
                                   HasSubstr("pool5 process 1")));
}

TEST_F(TimeLimit, WhoMayServeATaskDecidesWhatTheMixNeeds) {
  auto o = options({{"dsp", ""}, {"gpu", ""}, {"fast", ""}}, "^pool[25]$");
  o.platform.units[2].role = Role::kCpu;
  o.first = {{"pool5", {"cpu", "dsp"}}, {"pool2", {}}};
  std::vector<std::string> first;
  for (const PlannedCell& cell : plan_campaign(o).cells) {
    if (cell.first) first.push_back(cell.workload->name + " " + cell.unit);
  }
  EXPECT_THAT(first, UnorderedElementsAre("pool5 dsp", "pool5 fast", "pool2 dsp", "pool2 gpu",
                                          "pool2 fast"));
}

TEST_F(TimeLimit, ARunThatIsGoneOnWithKnowsItsMix) {
  auto o = shipped();
  o.mix = "tour";
  o.first = {{"pool5", {"gpu"}}};
  run(o, 2);
  const auto rest = resumed();
  EXPECT_EQ(rest.mix, "tour");
  EXPECT_EQ(rest.first, o.first);
}

TEST_F(TimeLimit, OfAQuickRunIsThreeMinutesInAll) {
  auto o = options({{"gpu", ""}});
  EXPECT_EQ(plan_campaign(o).max_time, std::chrono::minutes(3));
  EXPECT_LT(plan_campaign(o).precision_time, std::chrono::minutes(3));
  o.filter = "";
  const CampaignPlan all = plan_campaign(o);
  EXPECT_EQ(all.max_time, std::chrono::minutes(3));
  EXPECT_LE(all.precision_time, all.max_time);
  EXPECT_LE(all.estimate.total, all.max_time);
  o.max_time = std::chrono::seconds(7);
  EXPECT_EQ(plan_campaign(o).precision_time, std::chrono::seconds(7));
  EXPECT_LE(plan_campaign(o).estimate.total, std::chrono::seconds(7));
}

TEST_F(TimeLimit, OfAQuickRunIsLongerByWhatMetersTakeAndBySixMinutesAtMost) {
  const test::SysfsTree tree;
  tree.write("class/hwmon/hwmon0/name", "power_meter");
  tree.write("class/hwmon/hwmon0/power1_average", "1200000000");
  auto o = options({{"gpu", ""}});
  o.sysfs = tree.root();
  o.platform.units.front().meter = "power_meter/power1";
  // Three times three windows of 0.5 s, of two cells.
  const CampaignPlan plan = plan_campaign(o);
  EXPECT_EQ(plan.max_time, std::chrono::seconds(180 + 9));
  EXPECT_LE(plan.estimate.needed, plan.max_time);
  // Windows of 50 s.
  tree.write("class/hwmon/hwmon0/power1_average_interval", "10000");
  EXPECT_EQ(plan_campaign(o).max_time, std::chrono::minutes(9));
}

TEST_F(TimeLimit, TheEstimateCountsPeaksAndTimesOfUnits) {
  auto o = options({{"gpu", ""}}, "^pool5$");
  const Nanos without = plan_campaign(o).estimate.needed;
  o.unit_times = [](const UnitRecord&) {
    return std::vector<UnitTimePart>{{.expected = std::chrono::seconds(20), .measure = {}}};
  };
  EXPECT_EQ(plan_campaign(o).estimate.needed, without + std::chrono::seconds(20));
  o.platform = test::fake_platform({{"gpu", ""}, {"dsp", "unsupported: [pool5]"}});
  EXPECT_EQ(plan_campaign(o).estimate.needed, without + std::chrono::seconds(20))
      << "a unit without cells has none";
}

class UnitTimes : public TimeLimit {
 protected:
  /// Three rows, each with 20 samples of 1 us.
  static std::vector<UnitTimePart> parts(const std::function<void(UnitPhase)>& before) {
    std::vector<UnitTimePart> all;
    for (const UnitPhase phase : {UnitPhase::kHandover, UnitPhase::kLeave, UnitPhase::kReread}) {
      all.push_back(
          {.phase = phase, .samples = 20, .portion = 8, .measure = [phase, before](int samples) {
             before(phase);
             return std::vector<Nanos>(static_cast<std::size_t>(samples), Nanos(1000));
           }});
    }
    return all;
  }

  [[nodiscard]] std::vector<UnitPhase> stored() const {
    std::vector<UnitPhase> phases;
    for (const UnitTimeRow& each : load_profile(folder / "p.db").unit_times) {
      EXPECT_EQ(each.samples, 20);
      EXPECT_TRUE(is_used(each));
      phases.push_back(each.phase);
    }
    return phases;
  }
};

TEST_F(UnitTimes, StopOnASignalKeepWhatThereIsAndGoOn) {
  std::atomic<bool> stop = false;
  auto o = shipped("^pool5$");
  o.stop = &stop;
  o.unit_times = [&stop](const UnitRecord&) {
    return parts([&stop](UnitPhase phase) { stop = phase == UnitPhase::kLeave; });
  };
  run(o);
  EXPECT_TRUE(summary.interrupted);
  EXPECT_EQ(summary.cells, 1);
  EXPECT_THAT(stored(), ElementsAre(UnitPhase::kHandover));
  EXPECT_EQ(finished(), "");

  std::vector<UnitPhase> asked;
  auto rest = resumed();
  rest.unit_times = [&asked](const UnitRecord&) {
    return parts([&asked](UnitPhase phase) { asked.push_back(phase); });
  };
  EXPECT_THAT(plan_campaign(rest).cells, IsEmpty());
  run(rest);
  EXPECT_TRUE(summary.complete());
  EXPECT_THAT(asked, Not(Contains(UnitPhase::kHandover)));
  EXPECT_THAT(stored(), ElementsAre(UnitPhase::kHandover, UnitPhase::kLeave, UnitPhase::kReread));
  EXPECT_NE(finished(), "");
}

TEST_F(UnitTimes, AreLeftOutWhenTheTimeIsOverAndCounted) {
  auto o = shipped("^pool5$");
  CampaignPlan* running = nullptr;
  o.unit_times = [&running](const UnitRecord&) {
    return parts([&running](UnitPhase) { running->max_time = Nanos(0); });
  };
  CampaignPlan plan = plan_campaign(o);
  running = &plan;
  summary = run_campaign(o, plan, {});
  EXPECT_EQ(summary.unit_times_left_out, 2);
  EXPECT_EQ(summary.cells, 1);
  EXPECT_FALSE(summary.complete());
  EXPECT_THAT(stored(), ElementsAre(UnitPhase::kHandover)) << "what had begun is kept";
}

TEST_F(UnitTimes, HaveTheirPartOfTheTime) {
  auto o = options({{"gpu", "process_factors: [1, 1.3]"}}, "^pool5$");
  o.max_time = std::chrono::seconds(10);
  o.unit_times = [](const UnitRecord&) {
    auto all = parts([](UnitPhase) {});
    for (UnitTimePart& each : all) each.expected = std::chrono::hours(1);
    return all;
  };
  run(o);
  // However long they are said to take, cells keep 7 of 8 parts; the rows need milliseconds.
  EXPECT_EQ(summary.cells, 1);
  EXPECT_EQ(summary.unit_times_left_out, 0);
}

TEST(UnitTimeSampler, DoubtsWhatFailedAfterItsFirstSamples) {
  int portions = 0;
  const auto measure = [&portions](int samples) {
    if (++portions > 1) throw_environment("no call was suspended");
    return std::vector<Nanos>(static_cast<std::size_t>(samples), Nanos(1000));
  };
  UnitTimeSampler sampler(0.02, nullptr);
  const auto record = sampler.measure(
      {"cpu",
       usable_cores(),
       {.phase = UnitPhase::kLeave, .samples = 200, .portion = 20, .measure = measure}});
  EXPECT_EQ(record.value().samples.size(), 20U);
  EXPECT_THAT(record->doubts, Contains("few_samples: no call was suspended"));
  EXPECT_THAT(record->reasons, IsEmpty());
}

TEST(JudgeUnitTime, DoubtsByTheRulesOfCalls) {
  const std::vector<Nanos> even(200, Nanos(1000));
  EXPECT_THAT(judge_unit_time(even, {}, 0.02).doubts, IsEmpty());
  EXPECT_THAT(judge_unit_time({Nanos(1000)}, {}, 0.02).doubts, ElementsAre("few_samples"));
  // Others used 25 % of the cores, or 5 % and the median is not precise.
  EXPECT_THAT(judge_unit_time(even, {.contended = true, .crowded = true}, 0.02).doubts,
              ElementsAre("contended"));
  EXPECT_THAT(judge_unit_time(even, {.contended = true}, 0.02).doubts, IsEmpty());
  EXPECT_THAT(judge_unit_time(even, {.throttled = true}, 0.02).doubts, ElementsAre("throttled"));
  std::vector<Nanos> drifting(100, Nanos(1000));
  drifting.resize(200, Nanos(2000));
  EXPECT_THAT(judge_unit_time(drifting, {}, 0.02).doubts, Contains("unstable"));
  // 10 at 1 us and 10 at 9 us in turns: the interval of the median is all of that.
  std::vector<Nanos> wide;
  for (int i = 0; i < 10; ++i) wide.insert(wide.end(), {Nanos(1000), Nanos(9000)});
  EXPECT_THAT(judge_unit_time(wide, {}, 0.02).doubts, ElementsAre("imprecise"));
  EXPECT_THAT(judge_unit_time(wide, {.contended = true}, 0.02).doubts,
              ElementsAre("imprecise", "contended"));
  EXPECT_THAT(judge_unit_time(wide, {}, 0.02).reasons, IsEmpty());
}

TEST(UnitTimeSampler, HasAReasonWhereNothingCouldBeMeasuredAndElseWhatThereIs) {
  UnitTimeSampler sampler(0.02, nullptr);
  int calls = 0;
  PlannedUnitTime planned{.unit = "cpu", .cores = {0}, .part = {}};
  planned.part.samples = 40;
  planned.part.portion = 20;
  planned.part.measure = [&calls](int samples) -> std::vector<Nanos> {
    if (++calls > 1) throw Error(ErrorCode::kEnvironment, "no core");
    return std::vector<Nanos>(static_cast<std::size_t>(samples), Nanos(5));
  };
  const auto some = sampler.measure(planned).value();
  EXPECT_EQ(some.samples.size(), 20U);
  EXPECT_TRUE(is_used(some));
  const auto none = sampler.measure(planned).value();
  EXPECT_THAT(none.samples, IsEmpty());
  EXPECT_THAT(none.reasons, ElementsAre("error: no core"));
}

}  // namespace
}  // namespace pirt
