// In which order cells are visited, how many processes they get, and going on after an
// interruption.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <set>

#include "characterize/campaign/campaign.h"
#include "characterize/campaign/cell.h"
#include "characterize/profile/store/reader.h"
#include "characterize/profile/store/writer.h"
#include "tests/characterize/campaign/campaign_support.h"
#include "tests/support/paths.h"

namespace pirt {
namespace {

using test::error_of;
using test::row;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class Rounds : public test::Campaign {
 protected:
  /// "pool2 process 1, cold set-up" for each step of the run.
  std::vector<std::string> steps_of(const CampaignOptions& o) {
    std::vector<std::string> steps;
    ProgressSink sink;
    sink.progress = [&steps](const Progress& p) {
      if (p.step != "reference") steps.push_back(p.workload + " " + p.step);
    };
    summary = run_campaign(o, plan_campaign(o), sink);
    return steps;
  }

  /// A run of platform fake that can be gone on with, ended by @p end at the @p at-th step.
  void interrupt(CampaignOptions& o, int at, const std::function<void()>& end) {
    ProgressSink sink;
    int steps = 0;
    sink.progress = [&](const Progress&) {
      if (++steps == at) end();
    };
    summary = run_campaign(o, plan_campaign(o), sink);
  }

  CampaignOptions shipped(const std::string& filter) {
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
};

TEST_F(Rounds, VisitEveryCellOnceInAnOrderThatTheSeedDecides) {
  auto o = options({{"gpu", ""}}, "^pool");
  const auto order = [](const std::vector<std::string>& steps, std::size_t round) {
    std::vector<std::string> names;
    for (std::size_t i = 3 * round; i < 3 * round + 3; ++i)
      names.push_back(steps.at(i).substr(0, 5));
    return names;
  };
  const auto steps = steps_of(o);
  ASSERT_EQ(steps.size(), 12U);  // 3 cells x 4 processes, and no more: precise from the start
  std::set<std::vector<std::string>> orders;
  for (std::size_t round = 0; round < 4; ++round) {
    EXPECT_THAT(order(steps, round), ::testing::UnorderedElementsAre("pool1", "pool2", "pool5"));
    orders.insert(order(steps, round));
  }
  EXPECT_GT(orders.size(), 1U);
  EXPECT_EQ(steps_of(o), steps);
  o.seed = 2;
  EXPECT_NE(steps_of(o), steps);
}

TEST_F(Rounds, TakeColdAndWarmSetUpsInTurns) {
  const auto steps = steps_of(options({{"gpu", ""}}, "^pool5$"));
  EXPECT_THAT(steps, ElementsAre("pool5 process 1, cold set-up", "pool5 process 2, warm set-up",
                                 "pool5 process 3, cold set-up", "pool5 process 4, warm set-up"));
  for (const RowSamples& samples : load_samples(folder / "p.db", 1)) {
    const std::set<std::int32_t> processes(samples.processes.begin(), samples.processes.end());
    const std::set<std::int32_t> all = samples.state == State::kSteady
                                           ? std::set<std::int32_t>{0, 1, 2, 3}
                                           : std::set<std::int32_t>{0, 1};
    EXPECT_EQ(processes, all) << to_string(samples.phase);
  }
}

TEST_F(Rounds, AFullRunTakesFiveOfEach) {
  auto o = options({{"gpu", ""}}, "^pool5$");
  o.quick = false;
  const Profile profile = measure(o);
  EXPECT_EQ(row(profile, "pool5", Phase::kPrepare, State::kCold).samples, 5);
  EXPECT_EQ(row(profile, "pool5", Phase::kPrepare, State::kWarm).samples, 5);
  EXPECT_EQ(row(profile, "pool5", Phase::kCall).processes, 10);
  EXPECT_EQ(summary.within_precision, 1);
}

TEST_F(Rounds, GoOnUntilTheMedianOverProcessesIsPrecise) {
  // Cold processes and the first warm one are 10 % apart, the others alike: with 4 processes half
  // the interval is 8.7 %; it narrows as the ones at 1 outnumber those at 1.1.
  auto o = options({{"gpu", "process_factors: [1, 1.1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"}},
                   "^pool5$");
  o.max_time = std::chrono::seconds(60);
  const Profile profile = measure(o);
  const PhaseRow& call = row(profile, "pool5", Phase::kCall);
  EXPECT_GT(call.processes, 4);
  EXPECT_LT(call.processes, 16);
  EXPECT_THAT(call.notes, Not(Contains("precision_not_reached")));
  EXPECT_EQ(summary.within_precision, 1);
  EXPECT_EQ(row(profile, "pool5", Phase::kPrepare, State::kWarm).samples, call.processes - 2);
}

TEST_F(Rounds, EndAtTheTimeForPrecisionButNotBeforeRowsAreValid) {
  auto o = options({{"gpu", "process_factors: [1, 1.1]"}}, "^pool[25]$");
  o.precision_time = Nanos(1);
  const Profile profile = measure(o);
  EXPECT_EQ(summary.processes, 8);
  EXPECT_EQ(summary.within_precision, 0);
  const PhaseRow& call = row(profile, "pool5", Phase::kCall);
  EXPECT_TRUE(is_valid(call));
  EXPECT_THAT(call.notes, Contains("precision_not_reached"));
  EXPECT_TRUE(call.ci_low.has_value());  // what was reached
}

TEST_F(Rounds, EndWithTheMostProcessesThatACellGets) {
  auto o = options({{"gpu", "process_factors: [1, 1.3]"}}, "^pool5$");
  o.max_time = std::chrono::minutes(5);
  const Profile profile = measure(o);
  EXPECT_EQ(row(profile, "pool5", Phase::kCall).processes, kMostProcesses);
  EXPECT_THAT(row(profile, "pool5", Phase::kCall).notes, Contains("precision_not_reached"));
}

TEST_F(Rounds, GiveTheTimeThatIsLeftToCellsThatItSufficesFor) {
  // One unit is precise with a few more processes; the other, whose processes differ by half, would
  // need more than there are, and gets none before the first one is done.
  auto o = options({{"dsp", "process_factors: [1, 1.1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"},
                    {"gpu", "process_factors: [1, 1.5]"}},
                   "^pool5$");
  o.max_time = std::chrono::seconds(60);
  std::vector<std::string> for_precision;
  ProgressSink sink;
  sink.progress = [&](const Progress& p) {
    if (p.step.ends_with("for precision")) for_precision.push_back(p.unit);
  };
  run_campaign(o, plan_campaign(o), sink);
  const auto first_gpu = std::ranges::find(for_precision, "gpu");
  EXPECT_GE(first_gpu - for_precision.begin(), 2);
  EXPECT_EQ(std::find(first_gpu, for_precision.end(), "dsp"), for_precision.end());
  EXPECT_GT(for_precision.end() - first_gpu, 50);
}

TEST_F(Rounds, SampleAgainWhatIsUnstableAndThenSaySo) {
  // Executing takes 1 ms for 60 calls, then 2 ms, in every process; a call 0.21 ms more. Preparing
  // and verifying take one call each, the warm-up of 30 ms 25; what is sampled in 120 ms is 33
  // short calls and then long ones.
  std::string samples = "samples_ms: {pool5: [";
  for (int i = 0; i < 60; ++i) samples += "1, ";
  for (int i = 0; i < 2000; ++i) samples += "2, ";
  const auto o = options({{"gpu", samples + "2]}"}}, "^pool5$");
  const auto steps = steps_of(o);
  ASSERT_EQ(steps.size(), 8U);
  EXPECT_EQ(steps[3], "pool5 process 4, warm set-up");
  for (std::size_t i = 4; i < 8; ++i) EXPECT_THAT(steps[i], HasSubstr("again (unstable)"));
  const Profile profile = load_profile(o.database);
  const PhaseRow& call = row(profile, "pool5", Phase::kCall);
  EXPECT_THAT(call.doubts, ElementsAre("unstable"));
  EXPECT_EQ(call.processes, 4);  // the later ones take the place of the earlier ones
}

TEST_F(Rounds, ReportProgressWithTimeLeft) {
  const auto o = options({{"gpu", ""}});
  std::vector<Progress> seen;
  ProgressSink sink;
  sink.progress = [&seen](const Progress& p) { seen.push_back(p); };
  run_campaign(o, plan_campaign(o), sink);
  ASSERT_EQ(seen.size(), 10U);  // 2 cells of a reference and 4 processes
  EXPECT_EQ(seen.front().done, 0);
  EXPECT_EQ(seen.back().done, 1);
  EXPECT_EQ(seen.back().cells, 2);
  EXPECT_GT(seen.front().estimated_left, seen.back().estimated_left);
  EXPECT_GT(seen.back().estimated_left, Nanos(0));
  EXPECT_LT(seen.front().elapsed, seen.back().elapsed);
}

TEST_F(Rounds, EstimateFromTheFiguresOfAnEarlierRun) {
  auto o = options({{"gpu", "prepare_ms: {cold: 60000, warm: 30000}"}}, "^pool5$");
  const auto before = plan_campaign(o).estimate;
  EXPECT_THAT(before.source, HasSubstr("virtual machine"));
  measure(o);
  const auto after = plan_campaign(o).estimate;
  EXPECT_THAT(after.source, HasSubstr("1 of the cells"));
  // 2 cold and 2 warm set-ups take 180 s, peaks and a reference 3 s; a second each for the rest is
  // far too much.
  EXPECT_GT(after.needed, std::chrono::seconds(183));
  EXPECT_LT(after.needed, std::chrono::seconds(187));
  EXPECT_EQ(after.total, kMostQuickTime) << "that is when it ends";
  o.filter = "^pool2$";  // of which the database knows nothing
  EXPECT_EQ(plan_campaign(o).estimate.needed, before.needed);
}

TEST_F(Rounds, KeepWhatWasMeasuredWhenInterrupted) {
  std::atomic<bool> stop = false;
  auto o = shipped("^pool[25]$");
  o.stop = &stop;
  interrupt(o, 9, [&stop] { stop = true; });  // 2 references, 6 processes, the seventh
  EXPECT_TRUE(summary.interrupted);
  EXPECT_EQ(summary.processes, 6);
  EXPECT_EQ(summary.cells_begun, 2);
  const Profile profile = load_profile(o.database);
  EXPECT_EQ(profile.runs.front().finished, "");
  EXPECT_EQ(row(profile, "pool5", Phase::kCall).processes, 3);
  EXPECT_TRUE(is_valid(row(profile, "pool5", Phase::kCall)));
  EXPECT_THAT(row(profile, "pool5", Phase::kPrepare, State::kWarm).doubts,
              ElementsAre("few_samples"));
}

TEST_F(Rounds, KeepWhatABoardDrawsAwakeWhenInterrupted) {
  ::setenv("PIRT_NVML", test::kNvmlStandIn, 1);
  ::setenv("NVML_STAND_IN", "boards=01 step_ms=2 call_w=1000", 1);
  std::atomic<bool> stop = false;
  auto o = options({{"gpu", ""}});
  o.platform.units.front().meter = "nvidia/0000:01:00.0";
  o.stop = &stop;
  auto plan = plan_campaign(o);
  plan.meters.at("gpu").window = from_ms(10);
  ProgressSink sink;
  sink.stored = [&stop](const CellName&) { stop = true; };
  summary = run_campaign(o, plan, sink);
  ::setenv("PIRT_NVML", "none", 1);
  ::unsetenv("NVML_STAND_IN");
  EXPECT_TRUE(summary.interrupted);
  EXPECT_TRUE(load_profile(o.database).runs.front().figure("meter.gpu.awake_w").has_value());
}

TEST_F(Rounds, GoOnWithAnInterruptedRun) {
  std::atomic<bool> stop = false;
  auto o = shipped("^pool[25]$");
  o.seed = 7;
  o.stop = &stop;
  interrupt(o, 9, [&stop] { stop = true; });
  const auto steps = steps_of(resumed());
  // Whichever cell had been visited a fourth time is not among them; the cache is gone, though.
  ASSERT_EQ(steps.size(), 4U);
  EXPECT_THAT(steps[0], HasSubstr("filling the kernel cache"));
  EXPECT_THAT(steps[1], HasSubstr("process 4, warm set-up"));
  EXPECT_THAT(steps[3], HasSubstr("process 4, warm set-up"));
  EXPECT_EQ(summary.run_id, 1);
  EXPECT_EQ(summary.cells, 2);
  const Profile profile = load_profile(o.database);
  EXPECT_EQ(profile.runs.size(), 1U);
  EXPECT_NE(profile.runs.front().finished, "");
  EXPECT_EQ(profile.runs.front().seed, 7U);
  for (const PhaseRow& r : profile.phases) EXPECT_TRUE(is_valid(r)) << to_string(r.phase);
  EXPECT_EQ(row(profile, "pool2", Phase::kCall).processes, 4);
  // None of the warm ones was cold: 2 ms and a call of 0.65 ms.
  EXPECT_EQ(row(profile, "pool2", Phase::kPrepare, State::kWarm).p99, from_ms(2.65));
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return resume_options(o.database); }),
              HasSubstr("no unfinished run"));
}

TEST_F(Rounds, GoOnWithAKilledRun) {
  auto o = shipped("^pool[25]$");
  const pid_t child = ::fork();
  if (child == 0) {
    ::setenv("TMPDIR", folder.path().c_str(), 1);  // what nobody can clean up goes with the test's
    interrupt(o, 7, [] { ::raise(SIGKILL); });
    ::_exit(1);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  const auto unfinished = find_unfinished_run(o.database);
  ASSERT_TRUE(unfinished);
  EXPECT_EQ(unfinished->visits.size(), 4U);  // every process that had ended
  steps_of(resumed());
  EXPECT_EQ(summary.processes, 4);
  EXPECT_EQ(row(load_profile(o.database), "pool5", Phase::kCall).processes, 4);
}

TEST_F(Rounds, RefuseToGoOnWithWhatAnotherVersionWrote) {
  RunHeader header = test::small_run();
  const auto refused = [&](const std::string& plan, const std::string& record) {
    header.plan = plan;
    {
      ProfileWriter writer(folder / "p.db");
      const auto run = writer.begin_run(header);
      writer.write_visit(run, {"pool5", "gpu"}, {0, State::kCold, record});
    }
    return error_of(ErrorCode::kBadInput, [&] { return resume_options(folder / "p.db"); });
  };
  EXPECT_THAT(refused("{\"version\": \"2\"}", ""), HasSubstr("run 1 cannot be gone on with"));
  EXPECT_THAT(refused("{\"version\": 1}", "pirt-record {\"done\": true}\n"),
              ::testing::AllOf(HasSubstr("run 2 cannot be gone on with (process 0 of pool5 on gpu"),
                               HasSubstr("start a new run")));
  EXPECT_THAT(refused("{\"version\": 1}", ""), HasSubstr("run 3 cannot be gone on with"));
}

TEST_F(Rounds, RefuseToGoOnOnAnotherMachine) {
  std::atomic<bool> stop = false;
  auto o = shipped("^pool5$");
  o.stop = &stop;
  interrupt(o, 3, [&stop] { stop = true; });
  auto other = resumed();
  other.resumed->run.environment["cpu_model"] = "another processor";
  const auto plan = plan_campaign(other);
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return run_campaign(other, plan); }),
              ::testing::AllOf(HasSubstr("cpu_model was 'another processor'"),
                               HasSubstr("start a new run")));
  auto upgraded = resumed();
  upgraded.resumed->run.environment["pirt_version"] = "0.0.1";
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return run_campaign(upgraded, plan); }),
              HasSubstr("pirt_version was '0.0.1'"));
  auto gone = resumed();
  gone.platform.units.erase(gone.platform.units.begin() + 1);  // gpu
  gone.units.clear();
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [&] { return plan_campaign(gone); }),
              HasSubstr("pool5 on gpu cannot be measured any more"));
  EXPECT_EQ(run_campaign(resumed(), plan_campaign(resumed())).cells, 1);  // still possible here
}

}  // namespace
}  // namespace pirt
