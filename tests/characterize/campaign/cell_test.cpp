// What a cell makes of the results of its processes: given by hand, nothing is run.
#include "characterize/campaign/cell.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/characterize/support.h"
#include "workloads/backends/registry.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Not;

JobResult a_process(double call_ms) {
  JobResult result;
  result.done = true;
  result.device = DeviceInfo{"scripted", "", "", 1, false};
  result.provenance = Provenance::kModelled;
  result.device_init = from_ms(1);
  result.prepare = from_ms(10);
  result.verification = "after timing: equal";
  result.phases = {{Phase::kExecute, std::vector<Nanos>(5, from_ms(call_ms / 2)), 1},
                   {Phase::kCall, std::vector<Nanos>(5, from_ms(call_ms)), 1}};
  return result;
}

class Cell : public ::testing::Test {
 protected:
  Cell()
      : platform(test::fake_platform({{"gpu", ""}})),
        runner("/no/such/program", Nanos(1), nullptr),
        cell({platform, platform.units[0], find_backend("fake"), find_workload("pool5"), Job(),
              Provenance::kModelled, 2, 0.02, folder.path(), [](std::string_view) {}},
             runner) {}

  /// The next visits, whatever they are for, with calls of that long.
  void add(std::initializer_list<double> calls_ms) {
    for (const double ms : calls_ms) cell.add(cell.next().value().setup, a_process(ms));
  }
  [[nodiscard]] PhaseRecord row(Phase phase) const {
    const auto phases = cell.record().phases;
    return *std::ranges::find(phases, phase, &PhaseRecord::phase);
  }

  test::TemporaryFolder folder;
  Platform platform;
  JobRunner runner;
  CellMeasurement cell;
};

TEST_F(Cell, NeedsItsSetUpsAndThenNoMoreIfItIsPrecise) {
  EXPECT_EQ(cell.needed_visits(), 4);
  add({10, 10});
  EXPECT_EQ(cell.needed_visits(), 2);
  EXPECT_EQ(cell.expected_visits(), 2);
  EXPECT_EQ(cell.next()->setup, State::kCold);
  add({10, 10});
  EXPECT_EQ(cell.next().has_value(), false);
  EXPECT_EQ(cell.reached(), 0);
  EXPECT_THAT(held_against(row(Phase::kCall)), IsEmpty());
  EXPECT_THAT(row(Phase::kCall).notes, IsEmpty());
  EXPECT_EQ(row(Phase::kPrepare).samples.size(), 2U);
}

// 2 W x 10 ms, and 1 pJ for each of 5e9 operations, which a process counted: 0.02 J + 0.005 J.
TEST_F(Cell, OperationsAndBytesAreThoseThatAProcessFound) {
  platform.units[0].op_pj = 1;
  add({10, 10, 10});
  auto counted = a_process(10);
  counted.ops = 5'000'000'000;
  counted.bytes = 77;
  cell.add(cell.next().value().setup, counted);
  const CellRecord record = cell.record();
  EXPECT_EQ(record.ops, 5'000'000'000);
  EXPECT_EQ(record.bytes, 77);
  EXPECT_NEAR(record.energy.value().energy_j.value(), 0.025, 1e-9);
}

TEST_F(Cell, KeepsWhatWasSampledWithColdCachesApart) {
  for (const double ms : {10, 10, 10, 10}) {
    JobResult result = a_process(ms);
    result.conditions = {
        {Condition::kColdCache, {Phase::kExecute, std::vector<Nanos>(5, from_ms(ms)), 1}}};
    cell.add(cell.next().value().setup, std::move(result));
  }
  EXPECT_EQ(row(Phase::kExecute).samples.front(), from_ms(5));
  const auto conditions = cell.record().conditions;
  ASSERT_EQ(conditions.size(), 1U);
  EXPECT_EQ(conditions[0].condition, Condition::kColdCache);
  EXPECT_EQ(conditions[0].phase, Phase::kExecute);
  EXPECT_EQ(conditions[0].samples.size(), 20U);
  EXPECT_EQ(conditions[0].processes.back(), 3);
  EXPECT_THAT(conditions[0].reasons, IsEmpty());
}

TEST_F(Cell, WantsAsManyProcessesAsItsPrecisionWillTake) {
  // Mean 10, deviation sqrt(0.08 / 3) = 0.163, t 3.182 * 0.163 / 2 = 0.26, but none was below 9.8:
  // 9.8 to 10.26, half of it 2.3 %. 4 processes x ((2.3 / 2)^2 - 1) = 1.3, so 2 more.
  add({9.8, 10, 10, 10.2});
  EXPECT_NEAR(cell.reached().value(), 0.023, 0.0001);
  EXPECT_FALSE(cell.next()->needed);
  EXPECT_EQ(cell.next()->setup, State::kWarm);
  EXPECT_EQ(cell.needed_visits(), 0);
  EXPECT_EQ(cell.expected_visits(), 2);
  EXPECT_THAT(row(Phase::kCall).notes, ElementsAre("precision_not_reached"));
  // With a fifth one: sqrt(0.08 / 4) = 0.141, 2.776 * 0.141 / sqrt(5) = 0.176. That looks precise,
  // but five do not tell.
  add({10});
  EXPECT_NEAR(cell.reached().value(), 0.0176, 0.0001);
  EXPECT_EQ(cell.next()->needed, false);
  EXPECT_EQ(cell.expected_visits(), 1);
  // Six: from the smallest to the largest.
  add({10});
  EXPECT_NEAR(cell.reached().value(), 0.02, 0.0001);
  EXPECT_FALSE(cell.next().has_value());
}

TEST_F(Cell, SaysThatItIsImpreciseAndThatItsProcessesFormTwoGroups) {
  // The truth is 0.12 ms; two processes ran alone, and the others beside something else.
  add({0.12, 24, 0.12, 26, 22, 20});
  EXPECT_THAT(row(Phase::kCall).doubts, ElementsAre("imprecise"));
  EXPECT_THAT(row(Phase::kCall).notes, ElementsAre("precision_not_reached", "bimodal"));
  EXPECT_THAT(row(Phase::kExecute).doubts, ElementsAre("imprecise"));
  EXPECT_THAT(held_against(row(Phase::kPrepare)), IsEmpty());
}

TEST_F(Cell, IsNotImpreciseForAPartThatMovesTheCallByLittle) {
  for (const double upload_ms : {0.1, 0.3, 0.1, 0.3, 0.2, 0.1}) {
    auto result = a_process(20);
    result.phases.push_back({Phase::kUpload, std::vector<Nanos>(5, from_ms(upload_ms)), 1});
    cell.add(cell.next()->setup, result);
  }
  const auto phases = cell.record().phases;
  const auto upload = std::ranges::find(phases, Phase::kUpload, &PhaseRecord::phase);
  ASSERT_NE(upload, phases.end());
  EXPECT_THAT(upload->reasons, IsEmpty());  // 0.1 ms of 20
  EXPECT_THAT(upload->notes, Contains("precision_not_reached"));
}

TEST_F(Cell, LooksAtExecuteAsWellAsAtCall) {
  for (const double execute_ms : {5.0, 6.0, 5.0, 6.0}) {
    auto result = a_process(20);
    result.phases[0].samples.assign(5, from_ms(execute_ms));
    cell.add(cell.next()->setup, result);
  }
  EXPECT_GT(cell.reached().value(), 0.1);
  EXPECT_THAT(row(Phase::kCall).notes, IsEmpty());
  EXPECT_THAT(row(Phase::kExecute).notes, Contains("precision_not_reached"));
}

TEST_F(Cell, StopsAtTheMostProcesses) {
  while (cell.next()) add({cell.processes() % 2 == 0 ? 10.0 : 13.0});
  EXPECT_EQ(cell.processes(), kMostProcesses);
  EXPECT_THAT(row(Phase::kCall).notes, ElementsAre("precision_not_reached", "bimodal"));
}

TEST_F(Cell, IsSampledAgainWhenUnstableAndBelievedIfThatIsStable) {
  add({10, 10, 12.5, 12.5});
  EXPECT_TRUE(cell.next()->needed);
  EXPECT_EQ(cell.needed_visits(), 4);
  EXPECT_THAT(row(Phase::kCall).doubts, ElementsAre("unstable"));
  add({12.5, 12.5, 12.5});
  EXPECT_THAT(row(Phase::kCall).doubts, ElementsAre("unstable"));  // as long as it is not over
  EXPECT_EQ(row(Phase::kCall).samples.front(), from_ms(10));
  add({12.5});
  EXPECT_FALSE(cell.next().has_value());
  EXPECT_THAT(held_against(row(Phase::kCall)), IsEmpty());
  EXPECT_THAT(row(Phase::kCall).samples, ::testing::Each(from_ms(12.5)));
  EXPECT_THAT(row(Phase::kCall).processes, Contains(3));
}

TEST_F(Cell, IsUnstableIfItStillIsTheSecondTime) {
  add({10, 10, 12.5, 12.5, 12.5, 12.5, 10, 10});
  EXPECT_FALSE(cell.next().has_value());
  EXPECT_THAT(row(Phase::kCall).doubts, ElementsAre("unstable"));
  EXPECT_THAT(held_against(row(Phase::kPrepare)), IsEmpty());
}

TEST_F(Cell, IsThrottledOrContendedIfAQuarterOfItsProcessesWere) {
  for (int i = 0; i < 4; ++i) {
    auto result = a_process(10);
    result.during_calls.throttled = result.during_calls.contended = i == 2;
    cell.add(cell.next()->setup, result);
  }
  EXPECT_THAT(row(Phase::kCall).doubts, ElementsAre("throttled"));
  EXPECT_THAT(row(Phase::kCall).notes, ElementsAre("contended"));
  EXPECT_THAT(held_against(row(Phase::kPrepare)), IsEmpty());
}

/// @p calls_ms in processes beside others, which took much if @p crowded.
void add_contended(CellMeasurement& cell, std::initializer_list<double> calls_ms, bool crowded) {
  for (const double ms : calls_ms) {
    auto result = a_process(ms);
    result.during_calls = {.contended = true, .crowded = crowded};
    cell.add(cell.next().value().setup, result);
  }
}

TEST_F(Cell, IsSampledAgainWhenContendedAndNotPreciseAndBelievedIfThatIsQuiet) {
  add_contended(cell, {10, 11, 10, 12}, false);
  EXPECT_TRUE(cell.next()->needed);
  EXPECT_EQ(cell.needed_visits(), 4);
  EXPECT_THAT(row(Phase::kCall).doubts, ElementsAre("contended"));
  EXPECT_THAT(row(Phase::kCall).notes, ElementsAre("precision_not_reached"));
  add({8, 8, 8, 8});
  EXPECT_FALSE(cell.next().has_value());
  EXPECT_THAT(held_against(row(Phase::kCall)), IsEmpty());
  EXPECT_THAT(row(Phase::kCall).samples, ::testing::Each(from_ms(8)));
}

TEST_F(Cell, IsContendedIfItStillIsTheSecondTimeAndStaysImprecise) {
  add_contended(cell, {10, 11, 10, 12}, false);
  add_contended(cell, {10, 11, 10, 12}, false);
  EXPECT_THAT(row(Phase::kCall).doubts, ElementsAre("contended"));
  EXPECT_EQ(cell.next()->needed, false);  // more processes may make it precise all the same
}

// 24.0 ms, as of all processes beside four busy loops, where the truth is 0.115 ms: no interval
// shows that.
TEST_F(Cell, IsNotBelievedBesideProgramsThatTakeMuchHoweverPreciseItLooks) {
  add_contended(cell, {24, 24, 24, 24}, true);
  EXPECT_EQ(cell.needed_visits(), 4);
  add_contended(cell, {24, 24, 24, 24}, true);
  EXPECT_FALSE(cell.next().has_value());
  EXPECT_EQ(cell.reached(), 0);
  EXPECT_THAT(row(Phase::kCall).doubts, ElementsAre("contended"));
  EXPECT_THAT(row(Phase::kExecute).doubts, ElementsAre("contended"));
}

/// Processes whose preparation took that long.
std::vector<JobResult> set_ups(std::initializer_list<double> prepare_ms) {
  std::vector<JobResult> results;
  for (const double ms : prepare_ms) {
    results.push_back(a_process(10));
    results.back().prepare = from_ms(ms);
  }
  return results;
}

TEST_F(Cell, JudgesSetUpsLikeCalls) {
  // Cold 100 and 200: of two, what they span: half of it is 33 % of 150. Warm 20 and 21.
  for (auto& result : set_ups({100, 20, 200, 21})) cell.add(cell.next()->setup, result);
  EXPECT_THAT(row(Phase::kPrepare).doubts, ElementsAre("imprecise"));
  const auto phases = cell.record().phases;
  for (const PhaseRecord& each : phases) {
    const bool cold = each.phase == Phase::kPrepare && each.state == State::kCold;
    EXPECT_EQ(is_valid(each), !cold) << to_string(each.phase) << to_string(each.state);
  }
}

TEST_F(Cell, SaysOfSetUpsThatTheyWereThrottledAndContended) {
  for (auto& result : set_ups({100, 20, 101, 21})) {
    result.during_setup = {.contended = true, .crowded = true, .throttled = true};
    cell.add(cell.next()->setup, result);
  }
  EXPECT_THAT(row(Phase::kPrepare).doubts, ElementsAre("throttled", "contended"));
  EXPECT_THAT(held_against(row(Phase::kCall)), IsEmpty());
}

TEST_F(Cell, DisregardsThrottlingOfOneProcessInFive) {
  for (int i = 0; i < 5; ++i) {
    auto result = a_process(i == 4 ? 10 : 9.5 + 0.3 * i);
    result.during_calls.throttled = result.during_calls.contended = i == 4;
    cell.add(cell.next()->setup, result);
  }
  EXPECT_THAT(held_against(row(Phase::kCall)), IsEmpty());
  EXPECT_THAT(row(Phase::kCall).notes, Not(Contains("contended")));
}

TEST_F(Cell, TakesTheCoarsestClockAndTheSmallestBatch) {
  for (int i = 0; i < 4; ++i) {
    auto result = a_process(0.1);
    result.phases[1].batch = i == 1 ? 1 : 100;
    result.clock = {i == 3 ? 2000.0 : 20.0, Nanos(1)};
    cell.add(cell.next()->setup, result);
  }
  EXPECT_THAT(row(Phase::kCall).reasons, ElementsAre("clock_bound"));  // 2 us of 100 us
}

TEST_F(Cell, TimesNoCallsAfterAWrongOutputButGoesOnSettingUp) {
  auto wrong = a_process(10);
  wrong.wrong_output = true;
  wrong.verification = "before timing: element 0 differs";
  wrong.phases.clear();
  cell.add(State::kCold, wrong);
  EXPECT_EQ(cell.needed_visits(), 3);
  for (int i = 0; i < 3; ++i) {
    JobResult set_up = a_process(10);
    set_up.phases.clear();
    set_up.verification.clear();
    cell.add(cell.next()->setup, set_up);
  }
  EXPECT_FALSE(cell.next().has_value());
  EXPECT_EQ(cell.record().verification, "before timing: element 0 differs");
  EXPECT_THAT(row(Phase::kCall).reasons, ElementsAre("wrong_output"));
  EXPECT_THAT(row(Phase::kPrepare).reasons, ElementsAre("wrong_output"));
  EXPECT_THAT(held_against(row(Phase::kDeviceInit)), IsEmpty());
}

TEST_F(Cell, AContendedRowReachesDownToWhatProcessorTimeSays) {
  // Each call of 40 ms had its one core for 30: others had it for a quarter of the time.
  for (int i = 0; i < 8; ++i) {
    JobResult result = a_process(40);
    for (PhaseSamples& each : result.phases) {
      if (each.phase == Phase::kCall) each.cpu.assign(each.samples.size(), from_ms(30));
    }
    result.during_calls = {.contended = true, .crowded = true, .throttled = false};
    cell.add(cell.next().value_or(Visit{}).setup, result);
  }
  const PhaseRecord call = row(Phase::kCall);
  EXPECT_THAT(call.doubts, ElementsAre("contended"));
  ASSERT_TRUE(call.taken.has_value());
  const auto cores =
      platform.units[0].cores.empty() ? usable_cores().size() : platform.units[0].cores.size();
  EXPECT_NEAR(*call.taken, 1 - 0.75 / static_cast<double>(cores), 1e-9);
  const auto interval = statistics_of(call).interval;
  EXPECT_EQ(interval->low, scaled(from_ms(40), 1 - *call.taken));
  EXPECT_EQ(interval->high, from_ms(40));
}

/// Processes whose calls of 40 ms compute on one core; others use so much beside each.
void add_serial(CellMeasurement& cell, std::initializer_list<double> others) {
  for (const double each : others) {
    JobResult result = a_process(40);
    for (PhaseSamples& samples : result.phases) {
      if (samples.phase == Phase::kCall) samples.cpu.assign(samples.samples.size(), from_ms(40));
    }
    result.during_calls = {.contended = each > 0, .others = each};
    cell.add(cell.next().value_or(Visit{}).setup, result);
  }
}

TEST_F(Cell, CoresThatACallLeavesIdleAreNotTakenFromIt) {
  platform.units[0].cores = {0, 1, 2, 3, 4, 5, 6, 7};
  add_serial(cell, {0.48, 0.48, 0.48, 0.48, 0.48, 0.48, 0.48, 0.48});
  const PhaseRecord call = row(Phase::kCall);
  ASSERT_TRUE(call.taken.has_value());
  EXPECT_NEAR(*call.taken, 0.48, 1e-9);
}

TEST_F(Cell, FromProcessesWithoutOthersNothingIsTaken) {
  platform.units[0].cores = {0, 1, 2, 3, 4, 5, 6, 7};
  add_serial(cell, {0.3, 0, 0, 0});
  const PhaseRecord call = row(Phase::kCall);
  EXPECT_THAT(call.notes, Contains("contended"));
  EXPECT_EQ(call.taken, 0);
}

TEST_F(Cell, OfFewProcessesSaysThatOthersMayDiffer) {
  add({10, 12});
  const PhaseRecord few = row(Phase::kCall);
  EXPECT_THAT(few.doubts, ElementsAre("few_samples"));
  const auto interval = statistics_of(few).interval;
  EXPECT_EQ(interval->low, scaled(from_ms(10), 1 / 1.5));
  EXPECT_EQ(interval->high, scaled(from_ms(12), 1.5));
  add({11, 10, 12});
  const auto known = statistics_of(row(Phase::kCall)).interval;
  EXPECT_GE(known->low, from_ms(10));
  EXPECT_LT(known->high, from_ms(15));

  PhaseRecord published = few;
  published.notes.emplace_back(kMeasuredElsewhere);
  EXPECT_EQ(statistics_of(published).interval, std::nullopt);
}

TEST_F(Cell, KeepsWhatWasSampledBeforeAFailure) {
  add({10, 10, 10});
  JobResult crashed;
  crashed.error = "worker crashed (SIGSEGV) while sampling";
  cell.add(State::kWarm, crashed);
  ASSERT_TRUE(cell.next().has_value()) << "tried once more";
  EXPECT_EQ(cell.visits(), cell.processes() + 1);
  cell.add(State::kWarm, crashed);
  EXPECT_FALSE(cell.next().has_value());
  EXPECT_THAT(row(Phase::kCall).notes, Contains("failed_processes: 2"));
  EXPECT_EQ(cell.needed_visits(), 0);
  EXPECT_THAT(row(Phase::kCall).reasons,
              ElementsAre("error: worker crashed (SIGSEGV) while sampling"));
  EXPECT_THAT(row(Phase::kCall).doubts, ElementsAre("few_samples"));
  EXPECT_EQ(row(Phase::kCall).samples.size(), 15U);
}

TEST_F(Cell, AFailureOfOneProcessIsTriedAgainAndNoted) {
  JobResult crashed;
  crashed.error = "worker crashed (SIGSEGV) while sampling";
  cell.add(State::kCold, crashed);
  add({10, 10, 10, 10});
  EXPECT_TRUE(row(Phase::kCall).reasons.empty());
  EXPECT_THAT(row(Phase::kCall).notes, Contains("failed_processes: 1"));
  EXPECT_EQ(row(Phase::kCall).samples.size(), 20U);
}

TEST_F(Cell, AReferenceThatFailedTwiceIsTwoFailedProcesses) {
  const CellRequest request{platform,
                            platform.units[0],
                            find_backend("fake"),
                            find_workload("pool5"),
                            Job(),
                            Provenance::kModelled,
                            2,
                            0.02,
                            folder.path(),
                            [](std::string_view) {}};
  const CellRecord record = failed_cell(request, "crashed");
  ASSERT_FALSE(record.phases.empty());
  for (const PhaseRecord& each : record.phases) {
    EXPECT_THAT(each.notes, Contains("failed_processes: 2"));
  }
}

TEST_F(Cell, AFailureThatThereWasNoTimeToTryAgainIsSaid) {
  EXPECT_FALSE(cell.believe_first_failure());
  JobResult crashed;
  crashed.error = "worker crashed (SIGSEGV) while sampling";
  cell.add(State::kCold, crashed);
  EXPECT_TRUE(cell.believe_first_failure());
  EXPECT_FALSE(cell.believe_first_failure());
  EXPECT_THAT(row(Phase::kCall).reasons, Contains("error: " + crashed.error));
}

TEST_F(Cell, AFailureBesideProcessesThatDidNotFailIsNone) {
  JobResult crashed;
  crashed.error = "worker crashed (SIGSEGV) while sampling";
  cell.add(State::kCold, crashed);
  add({10, 10, 10, 10});
  EXPECT_FALSE(cell.believe_first_failure());
}

}  // namespace
}  // namespace pirt
