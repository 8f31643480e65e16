// The gate on two stored profiles: each verdict, and how often it is wrong on simulated runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "reports/gate/gate_report.h"
#include "tests/reports/gate_runs.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/json.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

TEST(TableGate, FindsWhatBecameSlowerAndWhatFaster) {
  Machine machine(0.005, 0.01, 1);
  const Profile base = profile_of({machine.row("sobel", 10), machine.row("fc6", 20),
                                   machine.row("fc7", 30), machine.row("fc8", 5)});
  const Profile candidate = profile_of({machine.row("sobel", 11.5), machine.row("fc6", 20),
                                        machine.row("fc7", 24), machine.row("fc8", 5.1)});
  const auto result = judge_both(base, candidate);
  ASSERT_EQ(result.rows.size(), 4U);
  EXPECT_EQ(result.rows[0].verdict, GateVerdict::kSlower);
  EXPECT_NEAR(*result.rows[0].ratio, 1.15, 0.02);
  EXPECT_NEAR(*result.rows[0].change, 0.15, 0.02);
  EXPECT_GT(*result.rows[0].at_least, 0.10);
  EXPECT_EQ(result.rows[1].verdict, GateVerdict::kSame);
  EXPECT_EQ(result.rows[2].verdict, GateVerdict::kFaster);
  EXPECT_EQ(result.rows[3].verdict, GateVerdict::kSame) << "2 % are below the effect that counts";
  EXPECT_EQ(exit_code_of(result), 1);
}

GateRow judged(const PhaseRow& base, const PhaseRow& candidate) {
  return judge_both(profile_of({base}), profile_of({candidate})).rows[0];
}

// The rule of the README: 10 % and 5 % apart is slower, below 5 % for sure the same.
TEST(TableGate, IsSlowerBeyondTenPercentWithIntervalsApartAndElseUndecided) {
  const auto verdict = [](double ms, double width) {
    return judged(with_interval(10, width), with_interval(ms, width)).verdict;
  };
  EXPECT_EQ(verdict(11.05, 0.02), GateVerdict::kSlower) << "6.2 % apart";
  EXPECT_EQ(verdict(11.05, 0.03), GateVerdict::kUndecided) << "4 % apart";
  EXPECT_EQ(verdict(10.9, 0.001), GateVerdict::kUndecided) << "9 % for sure, and never the same";
  EXPECT_EQ(verdict(10.2, 0.01), GateVerdict::kSame);
  EXPECT_EQ(verdict(10.2, 0.03), GateVerdict::kUndecided) << "2 + 4.2 %";
  EXPECT_EQ(verdict(12.5, 0.08), GateVerdict::kSlower);
  EXPECT_EQ(verdict(8.9, 0.02), GateVerdict::kFaster);
  const GateRow nearly = judged(with_interval(10, 0.001), with_interval(10.9, 0.001));
  EXPECT_THAT(nearly.reason, HasSubstr("9.0 % more, where 10.0 % count"));
  const GateRow wide = judged(with_interval(10, 0.08), with_interval(10, 0.08));
  EXPECT_THAT(wide.reason, AllOf(HasSubstr("up to 12"), HasSubstr("5.0 % matter")));
}

// Half of the processes 38 % slower: the median may stay, and is not the same.
TEST(TableGate, HalfOfTheProcessesSlowerIsUndecided) {
  Machine exact(0, 0, 1);
  const auto run = [&](double half) {
    PhaseRow row = exact.row("sobel", 10, 37, 20);
    for (std::size_t i = 0; i < row.values.size(); ++i) {
      if (row.value_processes[i] % 2 == 1) row.values[i] = scaled(row.values[i], half);
    }
    summarize_row(row);
    return row;
  };
  const GateRow row = judged(run(1), run(1.38));
  EXPECT_EQ(row.verdict, GateVerdict::kUndecided);
  EXPECT_NEAR(*row.ratio, 1, 1e-9);
  EXPECT_THAT(row.reason, HasSubstr("up to 38.0 %"));
}

TEST(TableGate, UndecidedRowsPassUnlessStrict) {
  const auto result =
      judge_both(profile_of({with_interval(10, 0.08)}), profile_of({with_interval(10, 0.08)}));
  EXPECT_EQ(result.rows[0].verdict, GateVerdict::kUndecided);
  EXPECT_EQ(exit_code_of(result), 0);
  EXPECT_EQ(exit_code_of(result, true), 3);
}

TEST(TableGate, SaysNothingForSureOfRowsThatMetAnotherMachine) {
  for (const char* doubt : {"contended", "unstable", "throttled"}) {
    PhaseRow candidate = with_interval(20, 0.01);
    candidate.doubts = {doubt};
    const GateRow row = judged(with_interval(10, 0.01), candidate);
    EXPECT_EQ(row.verdict, GateVerdict::kUndecided);
    EXPECT_THAT(row.reason, HasSubstr(doubt));
  }
  PhaseRow candidate = with_interval(20, 0.01);
  candidate.doubts = {"imprecise"};
  EXPECT_EQ(judged(with_interval(10, 0.01), candidate).verdict, GateVerdict::kSlower)
      << "which its interval shows";
  // A set-up was taken by the processes of its cell's calls.
  Machine exact(0, 0, 1);
  const auto cell = [&](double ms, const std::vector<std::string>& doubts) {
    PhaseRow call = exact.row("sobel", 10, 6, 20, Phase::kCall);
    call.doubts = doubts;
    return profile_of({exact.row("sobel", ms, 6, 1, Phase::kPrepare, State::kWarm), call});
  };
  EXPECT_EQ(judge_both(cell(10, {}), cell(20, {})).rows[0].verdict, GateVerdict::kSlower);
  const auto doubted = judge_both(cell(10, {}), cell(20, {"contended"})).rows[0];
  EXPECT_EQ(doubted.verdict, GateVerdict::kUndecided);
  EXPECT_THAT(doubted.reason, HasSubstr("the candidate's call is contended"));
}

TEST(TableGate, PassesOverAPhaseThatIsNextToNothingOfItsCall) {
  Machine exact(0, 0, 1);
  const auto run = [&](double upload_ms, double launch_ms) {
    return profile_of({exact.row("sobel", upload_ms, 6, 20, Phase::kUpload),
                       exact.row("sobel", launch_ms, 6, 20, Phase::kLaunch),
                       exact.row("sobel", 10, 6, 20, Phase::kCall)});
  };
  const auto result = judge_both(run(2, 0.2), run(2.6, 0.3));
  EXPECT_EQ(result.rows[0].verdict, GateVerdict::kSlower) << "6 % of a call";
  EXPECT_NEAR(*result.rows[0].needed, 0.25, 1e-9) << "0.05 * 10 ms of 2 ms";
  EXPECT_EQ(result.rows[1].verdict, GateVerdict::kSame) << "half as long again, and 1 % of a call";
  EXPECT_NEAR(*result.rows[1].needed, 2.5, 1e-9);
  EXPECT_EQ(judge_both(run(2, 0.2), run(2, 0.8)).rows[1].verdict, GateVerdict::kSlower);
}

TEST(TableGate, ComparesNothingUnderAnotherIdentity) {
  Machine machine(0.005, 0.01, 1);
  const Profile base = profile_of({machine.row("sobel", 10)});
  Profile candidate = profile_of({machine.row("sobel", 20)});
  candidate.runs[0].environment["cpu_model"] = "two";
  const auto result = judge_both(base, candidate);
  EXPECT_EQ(result.rows[0].verdict, GateVerdict::kNotComparable);
  EXPECT_THAT(result.rows[0].reason, AllOf(HasSubstr("cpu_model"), HasSubstr("two")));
  EXPECT_EQ(exit_code_of(result), 3);
}

TEST(TableGate, SaysWhyARowCannotBeCompared) {
  Machine machine(0.005, 0.01, 1);
  const Profile base = profile_of({machine.row("sobel", 10), machine.row("fc6", 20),
                                   machine.row("fc7", 20), machine.row("fc8", 1)});
  Profile candidate =
      profile_of({machine.row("sobel", 10), machine.row("fc6", 20), machine.row("fc7", 20)});
  candidate.phases[0].reasons = {"clock_bound"};
  candidate.phases[1].ops = 200;
  const auto result = judge_both(base, candidate);
  EXPECT_THAT(result.rows[0].reason, HasSubstr("clock_bound"));
  EXPECT_THAT(result.rows[1].reason, HasSubstr("another size"));
  EXPECT_EQ(result.rows[2].verdict, GateVerdict::kSame);
  EXPECT_THAT(result.rows[3].reason, HasSubstr("no such cell"));
  EXPECT_EQ(result.count(GateVerdict::kNotComparable), 3);
  const auto added = judge_both(candidate, base);
  EXPECT_EQ(added.rows.back().verdict, GateVerdict::kNotJudged);
  EXPECT_THAT(added.rows.back().reason, HasSubstr("only the candidate"));
}

TEST(TableGate, FailsForWhatTheCandidateDidNotGetThrough) {
  Machine machine(0.005, 0.01, 1);
  const Profile base = profile_of({machine.row("sobel", 10)});
  const auto with = [&](std::vector<std::string> reasons, std::vector<std::string> notes) {
    Profile candidate = base;
    candidate.phases[0].reasons = std::move(reasons);
    candidate.phases[0].notes = std::move(notes);
    return candidate;
  };
  const auto code = [&](const Profile& candidate) {
    return exit_code_of(judge_both(base, candidate));
  };
  EXPECT_EQ(code(with({"wrong_output"}, {})), 1);
  EXPECT_EQ(code(with({"error: crashed"}, {"failed_processes: 2"})), 1);
  EXPECT_EQ(code(with({"error: crashed"}, {})), 3) << "one process";
  const Profile once = with({}, {"failed_processes: 1"});
  EXPECT_EQ(judge_both(base, once).rows[0].verdict, GateVerdict::kUndecided);
  Profile slower_once = profile_of({machine.row("sobel", 20)});
  slower_once.phases[0].notes = once.phases[0].notes;
  EXPECT_EQ(judge_both(base, slower_once).rows[0].verdict, GateVerdict::kSlower);
  EXPECT_EQ(judge_both(once, once).rows[0].verdict, GateVerdict::kSame);
  const Profile wrong = with({"wrong_output"}, {});
  EXPECT_EQ(judge_both(wrong, wrong).rows[0].verdict, GateVerdict::kUndecided);
  EXPECT_THAT(judge_both(wrong, wrong).rows[0].reason, HasSubstr("the base failed, too"));
}

TEST(TableGate, ANewCellThatFailsIsNoPass) {
  Machine machine(0.005, 0.01, 1);
  const Profile base = profile_of({machine.row("sobel", 10)});
  const auto code = [&](const std::string& reason, int processes) {
    Profile candidate = base;
    candidate.phases.push_back(machine.row("fc8", 5));
    candidate.phases[1].reasons = {reason};
    candidate.phases[1].notes = {"failed_processes: " + std::to_string(processes)};
    return exit_code_of(judge_both(base, candidate));
  };
  EXPECT_EQ(code("wrong_output", 0), 1);
  EXPECT_EQ(code("error: crashed", 2), 1);
  EXPECT_EQ(code("error: crashed", 1), 3);
  EXPECT_EQ(code("clock_bound", 0), 0);
}

TEST(TableGate, FailsForACellThatTheCandidatesPlanHasAndItHasNot) {
  Machine machine(0.005, 0.01, 1);
  const Profile base = profile_of({machine.row("sobel", 10), machine.row("fc6", 20)});
  Profile lost = profile_of({machine.row("sobel", 10)});
  lost.runs[0].run_id = lost.phases[0].run_id = 1;
  EXPECT_EQ(exit_code_of(judge_both(base, lost)), 3) << "not planned either";
  lost.runs[0].planned = {{"sobel", "cpu"}, {"fc6", "cpu"}};
  lost.runs[0].finished = "2026-01-01T00:01:00Z";
  const auto result = judge_both(base, lost);
  EXPECT_EQ(result.rows.back().verdict, GateVerdict::kFailed);
  EXPECT_THAT(result.rows.back().reason, HasSubstr("plan"));
  EXPECT_EQ(exit_code_of(result), 1);
  // An older run of the same file has it: that is not the candidate.
  Profile stale = base;
  stale.runs = {lost.runs[0], base.runs[0]};
  stale.runs[0].run_id = 2;
  stale.runs[1].run_id = 1;
  stale.phases[0].run_id = 2;
  stale.phases[1].run_id = 1;
  EXPECT_EQ(judge_both(base, stale).rows[0].verdict, GateVerdict::kSame);
  EXPECT_EQ(judge_both(base, stale).rows[1].verdict, GateVerdict::kFailed);
  // A run that ran out of time did not get there.
  for (Profile* cut : {&lost, &stale}) {
    cut->runs[0].finished = "";
    const auto open = judge_both(base, *cut);
    EXPECT_EQ(exit_code_of(open), 3);
    EXPECT_EQ(open.count(GateVerdict::kNotComparable), 1);
    EXPECT_THAT(open.rows.back().reason, HasSubstr("--resume"));
  }
  // A phase that is gone is no slower one, and not nothing.
  Profile without = base;
  without.phases[1] = machine.row("fc6", 20, 6, 20, Phase::kUpload);
  EXPECT_EQ(judge_both(base, without).rows.back().verdict, GateVerdict::kUndecided);
}

// The rows that the file has of them are another program's, which would hide what this one did.
TEST(TableGate, WhatARunThatBrokeOffDidNotReachIsNotWeighed) {
  Profile base = profile_of({}), candidate = profile_of({});
  RunInfo older = candidate.runs[0], broken = older;
  older.run_id = 1;
  older.finished = "2026-01-01T00:01:00Z";
  broken.run_id = 2;
  for (int i = 0; i < 15; ++i) {
    const bool reached = i < 7;
    PhaseRow row = with_interval(10, 0.01);
    row.workload = "w" + std::to_string(i);
    broken.planned.push_back({row.workload, row.unit});
    base.phases.push_back(row);
    if (reached) row = with_interval(11.5, 0.01);
    row.workload = broken.planned.back().workload;
    row.run_id = reached ? 2 : 1;
    candidate.phases.push_back(row);
    for (Profile* profile : {&base, &candidate}) {
      profile->energies.push_back(metered(profile == &base ? 1 : 1.2, 0.01));
      profile->energies.back().workload = row.workload;
    }
    candidate.energies.back().run_id = 1;
  }
  candidate.runs = {broken, older};
  const auto result = judge_both(base, candidate);
  EXPECT_EQ(std::ranges::count(result.rows, "all", &GateRow::workload), 1);
  EXPECT_EQ(result.count(GateVerdict::kInconclusive), 1) << "all that it measured moved together";
  EXPECT_EQ(result.count(GateVerdict::kSlower), 0);
  EXPECT_EQ(result.count(GateVerdict::kNotComparable), 2 * 8) << "times and joules";
  EXPECT_EQ(result.count(GateVerdict::kNotJudged), 7) << "joules of the older run";
}

TEST(TableGate, DoesNotJudgeWhatHasNoIntervalAndBlocksNothing) {
  Machine machine(0.005, 0.01, 1);
  const auto setup = [&](double ms, int processes) {
    return profile_of({machine.row("sobel", ms, processes, 1, Phase::kPrepare, State::kCold)});
  };
  const auto few = judge_both(setup(10, 2), setup(20, 2));
  EXPECT_EQ(few.rows[0].verdict, GateVerdict::kNotJudged);
  EXPECT_THAT(few.rows[0].reason, HasSubstr("too few processes"));
  EXPECT_EQ(few.rows[0].phase, "prepare cold");
  EXPECT_TRUE(few.rows[0].setup);
  EXPECT_EQ(exit_code_of(few, true), 0);
  // A run that was cut short is no pass of its calls.
  const Profile one = profile_of({machine.row("sobel", 10, 1, 100)});
  EXPECT_EQ(judge_both(one, one).rows[0].verdict, GateVerdict::kUndecided)
      << "its samples' interval";
  const Profile two = profile_of({machine.row("sobel", 10, 2)});
  EXPECT_EQ(judge_both(two, two).rows[0].verdict, GateVerdict::kUndecided);
  EXPECT_EQ(exit_code_of(judge_both(two, two), true), 3);
  EXPECT_EQ(judge_both(setup(10, 5), setup(13, 5)).rows[0].verdict, GateVerdict::kSlower);
  EXPECT_EQ(judge_both(setup(10, 5), setup(11.5, 5)).rows[0].verdict, GateVerdict::kUndecided);
  EXPECT_EQ(judge_both(setup(0.1, 5), setup(0.3, 5)).rows[0].verdict, GateVerdict::kSame)
      << "a fifth of a millisecond, once a process";
}

TEST(TableGate, JudgesEnergyWhereItHasAnInterval) {
  Machine machine(0.005, 0.01, 1);
  const auto run = [&](const EnergyRow& energy) {
    Profile profile = profile_of({machine.row("sobel", 10)});
    profile.energies = {energy};
    return profile;
  };
  const auto verdict = [&](const EnergyRow& base, const EnergyRow& candidate) {
    return judge_both(run(base), run(candidate)).rows.back().verdict;
  };
  EXPECT_EQ(verdict(metered(1, 0.01), metered(1.3, 0.01)), GateVerdict::kSlower);
  EXPECT_EQ(verdict(metered(1, 0.01), metered(1.02, 0.01)), GateVerdict::kSame);
  EXPECT_EQ(verdict(metered(1, 0.2), metered(1.3, 0.2)), GateVerdict::kUndecided);
  EnergyRow beside = metered(1.3, 0.01);
  beside.source = "rapl: package-0; contended";
  EXPECT_EQ(verdict(metered(1, 0.01), beside), GateVerdict::kUndecided);
  EnergyRow single = metered(1.3, 0.01);
  single.ci_low_j = single.ci_high_j = std::nullopt;
  EXPECT_EQ(verdict(metered(1, 0.01), single), GateVerdict::kNotJudged);
  EnergyRow modelled = metered(1.3, 0.01);
  modelled.provenance = Provenance::kModelled;
  EXPECT_EQ(verdict(modelled, modelled), GateVerdict::kNotJudged);
  EXPECT_EQ(verdict(metered(1, 0.01), modelled), GateVerdict::kNotComparable);
  EnergyRow board = metered(1, 0.01);
  board.domain = "board";
  EXPECT_EQ(verdict(metered(1, 0.01), board), GateVerdict::kNotComparable);
  EnergyRow none = metered(1, 0.01);
  none.energy_j = none.ci_low_j = none.ci_high_j = std::nullopt;
  none.reasons = {"not_above_idle: 1 W"};
  EXPECT_EQ(verdict(none, none), GateVerdict::kNotJudged);
  EXPECT_EQ(exit_code_of(judge_both(run(none), run(none)), true), 0);
  EXPECT_EQ(verdict(metered(1, 0.01), none), GateVerdict::kUndecided);
}

TEST(TableGate, WhatNeitherRunCouldMeasureBlocksNothing) {
  Machine machine(0.005, 0.01, 1);
  const auto run = [&](const std::vector<std::string>& reasons) {
    PhaseRow warm = machine.row("sobel", 1, 6, 1, Phase::kPrepare, State::kWarm);
    warm.reasons = reasons;
    return profile_of({machine.row("sobel", 10), warm});
  };
  const auto neither = judge_both(run({"no_samples"}), run({"no_samples"}));
  EXPECT_EQ(neither.rows[1].verdict, GateVerdict::kNotJudged);
  EXPECT_THAT(neither.rows[1].reason, HasSubstr("no_samples"));
  EXPECT_EQ(exit_code_of(neither), 0);
  EXPECT_EQ(exit_code_of(judge_both(run({"no_samples"}), run({}))), 3);
  EXPECT_EQ(exit_code_of(judge_both(run({"no_samples"}), run({"wrong_output"}))), 1);
}

TEST(TableGate, ComparesRowsByTheirOwnRuns) {
  Machine machine(0.005, 0.01, 1);
  Profile base = profile_of({machine.row("sobel", 10), machine.row("fc8", 5)});
  base.runs = {base.runs[0], base.runs[0]};
  base.runs[0].run_id = base.phases[0].run_id = 2;
  base.runs[0].seed = 8;
  base.runs[1].run_id = base.phases[1].run_id = 1;
  base.runs[1].seed = 7;
  Profile candidate = profile_of({machine.row("sobel", 10), machine.row("fc8", 5)});
  candidate.runs[0].seed = 8;
  const auto result = judge_both(base, candidate);
  EXPECT_EQ(result.rows[0].verdict, GateVerdict::kSame);
  EXPECT_EQ(result.rows[1].verdict, GateVerdict::kNotComparable);
  EXPECT_EQ(result.rows[1].reason, "seed: 7 against 8");
}

/// 300 calls of @p ms by @p processes, of which every @p nth takes ten times as long (0: none), in
/// @p spoilt of them.
PhaseRow calls_with_tail(double ms, int nth, int spoilt = 6, int processes = 6) {
  Machine machine(0.002, 0.005, 3);
  PhaseRow row = machine.row("sobel", ms, processes, 300 / processes, Phase::kCall);
  for (int i = 0; nth > 0 && i < static_cast<int>(row.values.size()); i += nth) {
    const auto at = static_cast<std::size_t>(i);
    if (row.value_processes[at] < spoilt) row.values[at] = scaled(row.values[at], 10);
  }
  summarize_row(row);
  return row;
}

TEST(TableGate, FindsATailThatNoMedianShows) {
  const auto rows = [](const PhaseRow& base, const PhaseRow& candidate) {
    return judge_both(profile_of({base}), profile_of({candidate})).rows;
  };
  const auto found = rows(calls_with_tail(2, 0), calls_with_tail(2, 25));
  EXPECT_EQ(found[0].verdict, GateVerdict::kSame) << "of the median";
  EXPECT_EQ(found[1].phase, "call tail");
  EXPECT_EQ(found[1].verdict, GateVerdict::kSlower);
  EXPECT_NEAR(*found[1].candidate, 0.04, 1e-9);
  EXPECT_THAT(found[1].reason, HasSubstr("12 of 300 calls took over 3 times"));
  EXPECT_EQ(rows(calls_with_tail(2, 25), calls_with_tail(2, 25))[1].verdict,
            GateVerdict::kUndecided)
      << "as many as before, but 2 % more are possible";
  EXPECT_EQ(rows(calls_with_tail(2, 0), calls_with_tail(2, 0))[1].verdict, GateVerdict::kSame);
  const auto one = rows(calls_with_tail(2, 0), calls_with_tail(2, 4, 1))[1];
  EXPECT_EQ(one.verdict, GateVerdict::kUndecided) << one.reason;
  EXPECT_THAT(one.reason, HasSubstr("in few processes"));
  PhaseRow busy = calls_with_tail(2, 25);
  busy.notes = {"contended"};
  EXPECT_EQ(rows(calls_with_tail(2, 0), busy)[1].verdict, GateVerdict::kUndecided);
  PhaseRow hot = calls_with_tail(2, 25);
  hot.doubts = {"throttled"};
  const auto doubted = rows(calls_with_tail(2, 0), hot)[1];
  EXPECT_EQ(doubted.verdict, GateVerdict::kUndecided);
  EXPECT_THAT(doubted.reason, HasSubstr("the candidate's call is throttled"));
  for (const int processes : {1, 2}) {
    const auto cut = rows(calls_with_tail(2, 0), calls_with_tail(2, 25, 6, processes))[1];
    EXPECT_EQ(cut.verdict, GateVerdict::kUndecided);
    EXPECT_THAT(cut.reason, HasSubstr("too few processes"));
  }
  const auto batches = rows(calls_with_tail(0.2, 0), calls_with_tail(0.2, 25))[1];
  EXPECT_EQ(batches.verdict, GateVerdict::kNotJudged);
  EXPECT_THAT(batches.reason, HasSubstr("means over batches"));
  Machine machine(0.002, 0.005, 3);
  const PhaseRow few = machine.row("sobel", 2, 6, 20, Phase::kCall);
  EXPECT_THAT(rows(few, few)[1].reason, HasSubstr("120 samples, 200"));
}

TEST(TableGate, WhatTheMachineMadeLongerIsNoTail) {
  const auto run_of = [](const PhaseRow& calls, double peaks) {
    Profile profile = profile_of({calls});
    profile.peaks = {peak(PeakKind::kF32, 200e9 * peaks),
                     peak(PeakKind::kBandwidthMemory, 50e9 * peaks)};
    return profile;
  };
  const auto run = [&](double ms, double peaks) { return run_of(calls_with_tail(ms, 0), peaks); };
  const auto slow = judge_both(run(2, 1), run(6.6, 0.3));
  EXPECT_EQ(slow.count(GateVerdict::kSlower), 0) << "3.3 times, and the machine 3.33 times";
  ASSERT_EQ(slow.rows[1].phase, "call tail");
  EXPECT_EQ(*slow.rows[1].candidate, 0);
  EXPECT_EQ(judge_both(run(2, 1), run(6.6, 1)).rows[1].verdict, GateVerdict::kSlower);
  // The same tail on a machine that is 10 % slower: the base's calls are none that it made longer.
  const auto with_long_ones = [&](double ms, double peaks) {
    PhaseRow calls = calls_with_tail(ms, 0);
    for (std::size_t i = 0; i < calls.values.size(); i += 25) {
      calls.values[i] = scaled(calls.values[i], 3.2);
    }
    summarize_row(calls);
    return run_of(calls, peaks);
  };
  const GateRow alike = judge_both(with_long_ones(2, 1), with_long_ones(2.2, 1 / 1.1)).rows[1];
  EXPECT_EQ(alike.verdict, GateVerdict::kUndecided) << alike.reason;
  EXPECT_NEAR(*alike.change, 0, 1e-9);
  // What the machine may have made longer is not for sure the same either.
  const GateRow open = judge_both(run(2, 1), run_of(calls_with_tail(2, 25), 0.25)).rows[1];
  EXPECT_EQ(open.verdict, GateVerdict::kUndecided);
  EXPECT_THAT(open.reason, HasSubstr("12 over 3 times, which may be the machine's"));
}

/// 28 cells with a call and an execute row each, as a run of Table I on two units has.
Profile simulated_run(std::uint64_t seed, double slower) {
  Machine machine(0.01, 0.02, seed);
  std::vector<PhaseRow> rows;
  for (int cell = 0; cell < 28; ++cell) {
    const double ms = 1 + cell;
    const double factor = cell == 7 ? slower : 1;
    rows.push_back(machine.row("w" + std::to_string(cell), ms * factor));
    rows.push_back(machine.row("w" + std::to_string(cell), 1.1 * ms * factor, 6, 20, Phase::kCall));
  }
  return profile_of(std::move(rows));
}

TEST(TableGate, RaisesNoFalseAlarmAndFindsAQuarterInSimulation) {
  std::vector<Profile> runs;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) runs.push_back(simulated_run(seed, 1));
  int pairs = 0;
  int alarms = 0;
  int open = 0;
  for (const auto& base : runs) {
    for (const auto& candidate : runs) {
      if (&base == &candidate) continue;
      const int code = exit_code_of(judge_both(base, candidate));
      ++pairs;
      alarms += code == 1 ? 1 : 0;
      open += code == 3 ? 1 : 0;
    }
  }
  EXPECT_LE(alarms, pairs / 100);
  EXPECT_LE(open, pairs / 5);
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto result = judge_both(runs[seed - 1], simulated_run(100 + seed, 1.25));
    found +=
        std::ranges::any_of(result.rows,
                            [](const GateRow& row) {
                              return row.workload == "w7" && row.verdict == GateVerdict::kSlower;
                            })
            ? 1
            : 0;
  }
  EXPECT_GE(found, 18);
}

/// The simulated run with all its rows @p factor times as long.
Profile on_slower_machine(std::uint64_t seed, double factor, double slower = 1) {
  Profile profile = simulated_run(seed, slower);
  for (PhaseRow& row : profile.phases) {
    for (Nanos& value : row.values) value = scaled(value, factor);
    summarize_row(row);
  }
  return profile;
}

TEST(TableGate, WhereRowsDifferFromRunToRunOneThatDoesIsNothing) {
  // Each workload has met another machine in each run, whose processes agree with each other.
  const auto run_of = [](std::uint64_t seed, double slower) {
    Profile profile = simulated_run(seed, slower);
    Random random(seed);
    for (PhaseRow& row : profile.phases) {
      const double factor = 0.8 + 0.4 * (static_cast<double>(random.next() >> 11) * 0x1p-53);
      for (Nanos& value : row.values) value = scaled(value, factor);
      summarize_row(row);
    }
    return profile;
  };
  const auto result = judge_both(run_of(1, 1), run_of(2, 1));
  EXPECT_EQ(result.count(GateVerdict::kSlower), 0);
  EXPECT_EQ(exit_code_of(result), 0);
  const auto undecided = std::ranges::find_if(result.rows, [](const GateRow& row) {
    return row.reason.find("differ from run to run") != std::string::npos;
  });
  ASSERT_NE(undecided, result.rows.end());
  EXPECT_EQ(undecided->verdict, GateVerdict::kUndecided);
  EXPECT_EQ(exit_code_of(judge_both(run_of(1, 1), run_of(2, 8))), 1) << "eight times is something";
}

TEST(TableGate, WhatTheClockCannotTellOnEitherSideIsNotJudged) {
  Machine machine(0.005, 0.01, 1);
  PhaseRow bound = machine.row("fc8", 5);
  bound.reasons = {"clock_bound"};
  const Profile base = profile_of({machine.row("sobel", 10), bound});
  const auto result = judge_both(base, base);
  EXPECT_EQ(result.rows[1].verdict, GateVerdict::kNotJudged);
  EXPECT_EQ(exit_code_of(result), 0);
  PhaseRow told = bound;
  told.reasons.clear();
  const auto one = judge_both(base, profile_of({machine.row("sobel", 10), told}));
  EXPECT_EQ(one.rows[1].verdict, GateVerdict::kNotComparable);
}

TEST(TableGate, WhatAllRowsMovedByIsOneRowAndNobodysForSure) {
  const Profile base = simulated_run(1, 1);
  const auto find = [](const GateResult& result, const std::string& workload) {
    return *std::ranges::find(result.rows, workload, &GateRow::workload);
  };
  const auto result = judge_both(base, on_slower_machine(2, 1.3, 1.25));
  EXPECT_EQ(find(result, "w7").verdict, GateVerdict::kSlower) << "a quarter beyond the others";
  EXPECT_EQ(find(result, "w8").verdict, GateVerdict::kUndecided);
  const GateRow all = find(result, "all");
  EXPECT_EQ(all.verdict, GateVerdict::kInconclusive);
  EXPECT_NEAR(*all.ratio, 1.3, 0.03);
  EXPECT_THAT(all.reason, AllOf(HasSubstr("moved together"), HasSubstr("--baseline-program")));
  EXPECT_EQ(exit_code_of(judge_both(base, on_slower_machine(2, 1.09))), 3)
      << "each below what counts";
  const auto faster = judge_both(base, on_slower_machine(2, 0.8));
  EXPECT_EQ(find(faster, "all").verdict, GateVerdict::kFaster);
  EXPECT_EQ(exit_code_of(faster), 0);
  EXPECT_EQ(exit_code_of(judge_both(base, on_slower_machine(2, 1.02))), 0);
  // Rows that did not follow are not what all of them did: half of them 15 % slower is a slowdown.
  Profile half = simulated_run(2, 1);
  for (PhaseRow& row : half.phases) {
    if (row.workload.size() > 2 && row.workload < "w20") continue;
    for (Nanos& value : row.values) value = scaled(value, 1.15);
    summarize_row(row);
  }
  EXPECT_EQ(exit_code_of(judge_both(base, half)), 1);

  Profile other = on_slower_machine(2, 1.3);
  other.runs[0].environment["cpu_model"] = "two";
  const auto nothing = judge_both(base, other);
  EXPECT_EQ(nothing.count(GateVerdict::kNotComparable), std::ssize(nothing.rows))
      << "what cannot be compared has not moved either";
}

TEST(TableGate, WhatThePeaksMovedByIsTakenOffAndPrinted) {
  Profile base = profile_of({with_interval(10, 0.01)});
  Profile candidate = profile_of({with_interval(12, 0.01)});
  EXPECT_EQ(judge_both(base, candidate).rows[0].verdict, GateVerdict::kSlower);
  base.peaks = {peak(PeakKind::kF32, 200e9), peak(PeakKind::kBandwidthMemory, 50e9)};
  candidate.peaks = {peak(PeakKind::kF32, 200e9), peak(PeakKind::kBandwidthMemory, 40e9)};
  const auto explained = judge_both(base, candidate);
  EXPECT_EQ(explained.rows[0].verdict, GateVerdict::kUndecided) << "a fifth less bandwidth";
  GateReport report;
  report.result = explained;
  describe_rule(GateThresholds{}, report);
  EXPECT_THAT(report.notes[0],
              HasSubstr("by its own peaks: cpu f32 +0.0 % and memory bandwidth -20.0 %"));
  EXPECT_EQ(gate_json(report)["machine"][1]["ratio"], 0.8);
  base.energies = {metered(1, 0.01)};
  candidate.energies = {metered(1.2, 0.01)};
  EXPECT_EQ(judge_both(base, candidate).rows.back().verdict, GateVerdict::kUndecided);
  candidate.energies = {metered(1.5, 0.01)};
  EXPECT_EQ(judge_both(base, candidate).rows.back().verdict, GateVerdict::kSlower);
  base.energies = candidate.energies = {};
  // Beyond them it is the program's.
  candidate.phases[0] = with_interval(14, 0.01);
  EXPECT_EQ(judge_both(base, candidate).rows[0].verdict, GateVerdict::kSlower);
  // On a machine that became faster, as long as before is no longer the same.
  candidate.peaks = {peak(PeakKind::kF32, 240e9), peak(PeakKind::kBandwidthMemory, 60e9)};
  candidate.phases[0] = with_interval(10, 0.01);
  EXPECT_EQ(judge_both(base, candidate).rows[0].verdict, GateVerdict::kUndecided);
}

TEST(TableGate, StepsTooSmallToCountAddUpAgainstAnAnchor) {
  const auto run = [](double ms) { return profile_of({with_interval(ms, 0.003)}); };
  auto last = judge_both(run(10.92), run(11.41));
  EXPECT_EQ(exit_code_of(last), 0);
  add_anchor(judge_both(run(10), run(11.41)), last);
  EXPECT_EQ(exit_code_of(last), 1);
  EXPECT_TRUE(last.rows.back().against_anchor);
  GateReport report{.base = "b",
                    .candidate = "c",
                    .anchor = "old.db",
                    .result = last,
                    .decisions = {},
                    .rule = {}};
  EXPECT_THAT(
      render(gate_document(report, false), Format::kText),
      AllOf(HasSubstr("against the anchor old.db"), HasSubstr("execute, against the anchor")));
  EXPECT_EQ(gate_json(report)["rows"][1]["against"], "anchor");
  EXPECT_TRUE(gate_json(report)["anchor_identity_differences"].empty());
}

TEST(TableGate, WhatTheAnchorAloneHasWasTakenAway) {
  Machine machine(0.005, 0.01, 1);
  const Profile now = profile_of({machine.row("sobel", 10)});
  Profile anchor = profile_of({machine.row("sobel", 10), machine.row("fc6", 20)});
  auto result = judge_both(now, now);
  add_anchor(judge_both(anchor, now), result);
  EXPECT_EQ(exit_code_of(result), 0);
  // A cell that the base has and the candidate lacks is missing in both comparisons.
  result = judge_both(anchor, now);
  add_anchor(judge_both(anchor, now), result);
  EXPECT_EQ(result.count(GateVerdict::kNotComparable), 2);
  anchor.runs[0].environment["cpu_model"] = "two";
  result = judge_both(now, now);
  add_anchor(judge_both(anchor, now), result);
  EXPECT_EQ(exit_code_of(result), 3);
  GateReport report{.base = "b",
                    .candidate = "c",
                    .anchor = "old.db",
                    .result = result,
                    .decisions = {},
                    .rule = {}};
  const Json json = gate_json(report);
  EXPECT_TRUE(json["identity_differences"].empty());
  EXPECT_EQ(json["anchor_identity_differences"][0]["fact"], "cpu_model");
  EXPECT_EQ(json["anchor_identity_differences"][0]["anchor"], "two");
}

// What somebody accepted into the base is no failure for as long as the anchor holds still.
TEST(TableGate, ACellThatTheAnchorLacksIsTheBasesAffair) {
  Machine machine(0.005, 0.01, 1);
  const Profile anchor = profile_of({machine.row("sobel", 10)});
  Profile now = profile_of({anchor.phases[0], machine.row("fc6", 20)});
  now.phases[1].reasons = {"wrong_output"};
  auto accepted = judge_both(now, now);
  add_anchor(judge_both(anchor, now), accepted);
  EXPECT_EQ(exit_code_of(accepted), 0);
  auto fresh = judge_both(anchor, now);
  add_anchor(judge_both(anchor, now), fresh);
  EXPECT_EQ(exit_code_of(fresh), 1);
  EXPECT_EQ(fresh.count(GateVerdict::kFailed), 1);
}

}  // namespace
}  // namespace pirt::test
