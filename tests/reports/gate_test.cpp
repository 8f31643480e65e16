// The gate on two stored profiles: each verdict, and how often it is wrong on simulated runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "characterize/statistics/statistics.h"
#include "reports/gate/between_runs.h"
#include "reports/gate/gate_report.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/json.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// Samples of several processes, each a little apart from the others, as machines have them.
class Machine {
 public:
  Machine(double between, double within, std::uint64_t seed)
      : between_(between), within_(within), random_(seed) {}

  PhaseRow row(const std::string& workload, double ms, int processes = 3, int samples = 20,
               Phase phase = Phase::kExecute, State state = State::kSteady) {
    PhaseRow row;
    row.platform = "board";
    row.workload = workload;
    row.unit = "cpu";
    row.backend = "fake";
    row.phase = phase;
    row.state = state;
    row.ops = 100;
    row.bytes = 10;
    for (int p = 0; p < processes; ++p) {
      const double process_ms = ms * (1 + between_ * normal());
      for (int i = 0; i < samples; ++i) {
        row.values.push_back(from_ms(process_ms * (1 + within_ * std::abs(normal()))));
        row.value_processes.push_back(p);
      }
    }
    row.median = median(row.values);
    row.samples = std::ssize(row.values);
    return row;
  }

 private:
  double uniform() { return (static_cast<double>(random_.next() >> 11) + 0.5) * 0x1p-53; }
  double normal() {
    return std::sqrt(-2 * std::log(uniform())) * std::cos(2 * std::numbers::pi * uniform());
  }
  double between_, within_;
  Random random_;
};

Profile profile_of(std::vector<PhaseRow> rows) {
  Profile profile;
  profile.path = "p.db";
  RunInfo run;
  run.platform = "board";
  run.environment = {{"cpu_model", "one"}};
  run.identity = {"cpu_model"};
  run.units = {{"cpu", "fake", "simulated", true, {}}};
  profile.runs = {run};
  profile.phases = std::move(rows);
  return profile;
}

GateResult judge_both(const Profile& base, const Profile& candidate) {
  return judge(diff_profiles(base, candidate));
}

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
  EXPECT_LT(*result.rows[0].p, 0.001);
  EXPECT_EQ(result.rows[1].verdict, GateVerdict::kSame);
  EXPECT_EQ(result.rows[2].verdict, GateVerdict::kFaster);
  EXPECT_EQ(result.rows[3].verdict, GateVerdict::kSame) << "2 % are below the effect that counts";
  EXPECT_EQ(exit_code_of(result), 1);
}

/// Five processes of four samples each, from 6 % below to 6 % above @p ms.
Profile noisy_run(Machine& exact, double ms) {
  PhaseRow row = exact.row("sobel", ms, 5, 4);
  for (std::size_t i = 0; i < row.values.size(); ++i) {
    row.values[i] = from_ms(ms * (0.94 + 0.03 * row.value_processes[i]));
  }
  return profile_of({row});
}

TEST(TableGate, LeavesARiseNearTheNoiseBetweenRunsOpen) {
  Machine exact(0, 0, 1);
  const Profile base = noisy_run(exact, 10);
  const auto verdict = [&](double ms) { return judge_both(base, noisy_run(exact, ms)).rows[0]; };
  ASSERT_NEAR(*verdict(10).needed, 0.26, 0.01);
  EXPECT_EQ(verdict(11.0).verdict, GateVerdict::kCannotTell) << "far within the noise";
  EXPECT_EQ(verdict(12.3).verdict, GateVerdict::kInconclusive);
  EXPECT_THAT(verdict(12.3).reason, HasSubstr("measure again"));
  EXPECT_EQ(exit_code_of(judge_both(base, noisy_run(exact, 12.3))), 3);
  EXPECT_EQ(verdict(12.8).verdict, GateVerdict::kSlower);
}

TEST(TableGate, CannotTellWhereTheProcessesLeaveWhatCountsOpen) {
  Machine exact(0, 0, 1);
  const auto open = judge_both(noisy_run(exact, 10), noisy_run(exact, 10));
  const GateRow& row = open.rows[0];
  EXPECT_EQ(row.verdict, GateVerdict::kCannotTell) << "no change found, and none excluded";
  EXPECT_GT(*row.at_most, 0.05);
  EXPECT_THAT(row.reason, AllOf(HasSubstr("up to"), HasSubstr("5.0 % matter")));
  EXPECT_EQ(exit_code_of(open), 0) << "an answer that does not fail a build";

  // The same spread over many processes: their median is known well enough.
  const auto many = [&](double ms) {
    PhaseRow all = exact.row("sobel", ms, 60, 2);
    for (std::size_t i = 0; i < all.values.size(); ++i) {
      all.values[i] = from_ms(ms * (0.94 + 0.03 * (all.value_processes[i] * 7 % 5)));
    }
    return profile_of({all});
  };
  EXPECT_EQ(judge_both(many(10), many(10)).rows[0].verdict, GateVerdict::kSame);
  // Two processes have no interval at all.
  const Profile two = profile_of({exact.row("sobel", 10, 2, 20)});
  EXPECT_EQ(judge_both(two, two).rows[0].verdict, GateVerdict::kCannotTell);
  EXPECT_THAT(judge_both(two, two).rows[0].reason, HasSubstr("too few processes"));
}

TEST(TableGate, PassesOverAPhaseThatIsNextToNothingOfItsCall) {
  Machine exact(0, 0, 1);
  const auto run = [&](double upload_ms, double launch_ms) {
    return profile_of({exact.row("sobel", upload_ms, 3, 20, Phase::kUpload),
                       exact.row("sobel", launch_ms, 3, 20, Phase::kLaunch),
                       exact.row("sobel", 10, 3, 20, Phase::kCall)});
  };
  const auto result = judge_both(run(2, 0.2), run(2.4, 0.3));
  EXPECT_EQ(result.rows[0].verdict, GateVerdict::kSlower) << "4 % of a call";
  EXPECT_NEAR(*result.rows[0].needed, 0.125, 1e-9) << "0.025 * 10 ms of 2 ms";
  EXPECT_EQ(result.rows[1].verdict, GateVerdict::kSame) << "half as long again, and 1 % of a call";
  EXPECT_NEAR(*result.rows[1].needed, 1.25, 1e-9);
  EXPECT_EQ(judge_both(run(2, 0.2), run(2, 0.5)).rows[1].verdict, GateVerdict::kSlower);
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
  candidate.phases[0].reasons = {"wrong_output"};
  candidate.phases[1].ops = 200;
  const auto result = judge_both(base, candidate);
  EXPECT_THAT(result.rows[0].reason, HasSubstr("wrong_output"));
  EXPECT_THAT(result.rows[1].reason, HasSubstr("another size"));
  EXPECT_EQ(result.rows[2].verdict, GateVerdict::kSame);
  EXPECT_THAT(result.rows[3].reason, HasSubstr("no such cell"));
  EXPECT_EQ(result.count(GateVerdict::kNotComparable), 3);
}

TEST(TableGate, DoesNotJudgeAFewSamples) {
  Machine machine(0.005, 0.01, 1);
  const auto setup = [&](double ms, int processes) {
    return profile_of({machine.row("sobel", ms, processes, 1, Phase::kPrepare, State::kCold)});
  };
  const auto few = judge_both(setup(10, 5), setup(20, 5));
  EXPECT_EQ(few.rows[0].verdict, GateVerdict::kNotJudged);
  EXPECT_THAT(few.rows[0].reason, HasSubstr("5 samples"));
  EXPECT_EQ(few.rows[0].phase, "prepare cold");
  EXPECT_EQ(exit_code_of(few), 0);
  EXPECT_EQ(judge_both(setup(10, 9), setup(12, 9)).rows[0].verdict, GateVerdict::kSlower);
}

TEST(TableGate, JudgesMeteredEnergyOnly) {
  Machine machine(0.005, 0.01, 1);
  Profile base = profile_of({machine.row("sobel", 10)});
  Profile candidate = base;
  EnergyRow energy;
  energy.workload = "sobel";
  energy.unit = "cpu";
  energy.energy_j = 1.0;
  base.energies = {energy};
  energy.energy_j = 1.3;
  candidate.energies = {energy};
  EXPECT_EQ(judge_both(base, candidate).rows[1].verdict, GateVerdict::kNotJudged);
  base.energies[0].provenance = candidate.energies[0].provenance = Provenance::kMeasured;
  EXPECT_EQ(judge_both(base, candidate).rows[1].verdict, GateVerdict::kSlower);
  candidate.energies[0].energy_j = 1.05;
  EXPECT_EQ(judge_both(base, candidate).rows[1].verdict, GateVerdict::kSame);
}

/// Metered joules of eight cells, and one more.
Profile metered_run(const std::vector<double>& factors) {
  Machine exact(0, 0, 1);
  Profile profile = profile_of({exact.row("w0", 10)});
  for (std::size_t i = 0; i < factors.size(); ++i) {
    EnergyRow energy;
    energy.workload = "w" + std::to_string(i);
    energy.unit = "cpu";
    energy.energy_j = factors[i] * static_cast<double>(i + 1);
    energy.provenance = Provenance::kMeasured;
    profile.energies.push_back(energy);
  }
  return profile;
}

TEST(TableGate, JudgesMeteredEnergyByItsOwnNoise) {
  const Profile base = metered_run(std::vector<double>(9, 1.0));
  const auto last = [&](const std::vector<double>& factors) {
    return judge_both(base, metered_run(factors)).rows.back();
  };
  // Times are exact in all of them. 8 cells 2 % apart: 12 % is more than meters make of nothing.
  const auto quiet = last({0.98, 1.02, 1, 0.99, 1.01, 1, 0.98, 1.02, 1.12});
  EXPECT_EQ(quiet.verdict, GateVerdict::kSlower);
  EXPECT_NEAR(*quiet.needed, 0.10, 1e-9);
  // 8 cells 10 % apart: the same 12 % are nothing to speak of, nor is their absence; 80 % are.
  const std::vector<double> noisy = {0.9, 1.1, 1, 0.92, 1.08, 1, 0.9, 1.1};
  const auto with = [&](double factor) {
    auto all = noisy;
    all.push_back(factor);
    return last(all);
  };
  EXPECT_EQ(with(1.12).verdict, GateVerdict::kCannotTell);
  EXPECT_GT(*with(1.12).needed, 0.2);
  EXPECT_EQ(with(1.0).verdict, GateVerdict::kCannotTell);
  EXPECT_EQ(with(1.8).verdict, GateVerdict::kSlower);
  EXPECT_EQ(with(*with(1.12).needed * 0.9 + 1).verdict, GateVerdict::kInconclusive);
  EXPECT_EQ(with(0.5).verdict, GateVerdict::kFaster);
}

PhaseRow of_processes(std::vector<std::int64_t> ns) {
  PhaseRow row;
  for (std::size_t p = 0; p < ns.size(); ++p) {
    row.values.emplace_back(ns[p]);
    row.value_processes.push_back(static_cast<std::int32_t>(p));
  }
  std::ranges::sort(ns);
  row.median = Nanos(ns[ns.size() / 2]);
  return row;
}

TEST(BetweenRuns, SpreadIsTheMedianDeviationOfProcesses) {
  const std::array one = {100.0};
  EXPECT_FALSE(process_spread(one));
  const std::array few = {90.0, 100.0, 110.0};
  EXPECT_NEAR(*process_spread(few), 1.495 * 1.4826 * 0.1, 1e-9);
  const std::array many = {90.0, 92.0, 94.0, 96.0, 98.0, 102.0, 104.0, 106.0, 108.0, 300.0};
  EXPECT_NEAR(*process_spread(many), 10 / 9.2 * 1.4826 * 0.06, 1e-9)
      << "one far off does not count";
}

TEST(BetweenRuns, NoiseIsThatOfTheMediansAndTheDriftOfBothRuns) {
  const PhaseRow three = of_processes({90, 100, 110});
  const double spread = 1.495 * 1.4826 * 0.1;
  const auto expected = [&](double medians) {
    return spread * std::hypot(std::sqrt(std::numbers::pi / 2 * medians), kDrift * std::sqrt(2.0));
  };
  EXPECT_NEAR(*noise_between(three, three, Drift::kWhole), expected(2.0 / 3), 1e-9);
  const PhaseRow one = of_processes({100});
  EXPECT_NEAR(*noise_between(three, one, Drift::kWhole), expected(4.0 / 3), 1e-9);
  EXPECT_FALSE(noise_between(one, one, Drift::kWhole));
  const PhaseRow alike = of_processes({100, 100, 101});
  EXPECT_NEAR(*noise_between(alike, three, Drift::kWhole), expected(2.0 / 3), 1e-9)
      << "the larger spread";
}

TEST(BetweenRuns, DriftOfOneRowGrowsWithTheRootOfAWideSpread) {
  const auto row = [](std::int64_t apart) {
    return of_processes({10000 - apart, 10000, 10000 + apart});
  };
  const auto drift = [&](std::int64_t apart, Drift which) {
    const double medians =
        *spread_between(row(apart), row(apart)) * std::sqrt(std::numbers::pi / 3);
    const double noise = *noise_between(row(apart), row(apart), which);
    return std::sqrt(noise * noise - medians * medians);
  };
  EXPECT_NEAR(drift(100, Drift::kWhole), std::sqrt(2.0) * kDrift * 1.495 * 1.4826 * 0.01, 1e-9);
  EXPECT_NEAR(drift(100, Drift::kOfOneRow), drift(100, Drift::kWhole), 1e-9) << "3.1 %";
  EXPECT_NEAR(drift(1000, Drift::kOfOneRow), std::sqrt(kWideDrift * drift(1000, Drift::kWhole)),
              1e-9);
  EXPECT_GT(drift(200, Drift::kOfOneRow), kWideDrift);
  EXPECT_NEAR(drift(800, Drift::kOfOneRow), 2 * drift(200, Drift::kOfOneRow), 1e-9);
}

TEST(BetweenRuns, ChangeIsWhatMedianAndLowerQuartileAgreeOn) {
  const PhaseRow base = of_processes({100, 100, 100, 100, 100});
  const PhaseRow slower = of_processes({120, 120, 120, 120, 120});
  const PhaseRow busy = of_processes({100, 100, 150, 150, 150});
  const PhaseRow mixed = of_processes({95, 95, 150, 150, 150});
  EXPECT_NEAR(*change_between(base, slower, 0), std::log(1.2), 1e-12);
  EXPECT_NEAR(*change_between(slower, base, 0), -std::log(1.2), 1e-12);
  EXPECT_NEAR(*change_between(base, busy, 0), 0, 1e-12);
  EXPECT_EQ(*change_between(base, mixed, 0), 0);
  EXPECT_NEAR(*change_between(base, slower, std::log(1.1)), std::log(1.2 / 1.1), 1e-12);
  EXPECT_FALSE(change_between(base, of_processes({0, 0, 0}), 0));
}

/// 28 cells with a call and an execute row each, as a run of Table I on two units has.
Profile simulated_run(std::uint64_t seed, double slower) {
  Machine machine(0.01, 0.02, seed);
  std::vector<PhaseRow> rows;
  for (int cell = 0; cell < 28; ++cell) {
    const double ms = 1 + cell;
    const double factor = cell == 7 ? slower : 1;
    rows.push_back(machine.row("w" + std::to_string(cell), ms * factor));
    rows.push_back(machine.row("w" + std::to_string(cell), 1.1 * ms * factor, 3, 20, Phase::kCall));
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
    found += result.rows[14].verdict == GateVerdict::kSlower ? 1 : 0;
  }
  EXPECT_GE(found, 18);
}

/// The simulated run with all its rows @p factor times as long.
Profile on_slower_machine(std::uint64_t seed, double factor, double slower = 1) {
  Profile profile = simulated_run(seed, slower);
  for (PhaseRow& row : profile.phases) {
    for (Nanos& value : row.values) value = scaled(value, factor);
    row.median = scaled(*row.median, factor);
  }
  return profile;
}

TEST(TableGate, WhatAllRowsMovedByIsOneRowAndIsTakenOffTheOthers) {
  Profile base = simulated_run(1, 1);
  Profile candidate = on_slower_machine(2, 1.3, 1.25);
  const auto peak = [](PeakKind kind, double per_second) {
    PeakRow row;
    row.unit = "cpu";
    row.kind = kind;
    row.per_second = per_second;
    return row;
  };
  base.peaks = {peak(PeakKind::kF32, 200e9), peak(PeakKind::kBandwidthMemory, 50e9)};
  candidate.peaks = {peak(PeakKind::kF32, 150e9), peak(PeakKind::kBandwidthMemory, 40e9)};
  const auto result = judge_both(base, candidate);
  EXPECT_EQ(result.count(GateVerdict::kSlower), 2) << "call and execute of the one cell";
  EXPECT_EQ(result.rows[14].verdict, GateVerdict::kSlower);
  EXPECT_NEAR(*result.rows[14].change, 0.25, 0.05);
  EXPECT_NEAR(*result.rows[14].ratio, 1.625, 0.06);
  const GateRow& all = result.rows.back();
  EXPECT_EQ(all.workload, "all");
  EXPECT_EQ(all.verdict, GateVerdict::kInconclusive);
  EXPECT_NEAR(*all.ratio, 1.3, 0.02);
  EXPECT_THAT(all.reason, AllOf(HasSubstr("--baseline-program"), HasSubstr("f32 peak (-25.0 %)"),
                                HasSubstr("memory bandwidth (-20.0 %)")));

  const auto faster = judge_both(base, on_slower_machine(2, 0.8));
  EXPECT_EQ(faster.rows.back().verdict, GateVerdict::kFaster);
  EXPECT_EQ(exit_code_of(faster), 0);
  EXPECT_EQ(exit_code_of(judge_both(base, on_slower_machine(2, 1.02))), 0);

  Profile other = on_slower_machine(2, 1.3);
  other.runs[0].environment["cpu_model"] = "two";
  const auto nothing = judge_both(base, other);
  EXPECT_EQ(nothing.count(GateVerdict::kNotComparable), std::ssize(nothing.rows))
      << "what cannot be compared has not moved either";
}

PhaseRow call_row(const std::string& unit, std::int64_t low, std::int64_t median,
                  std::int64_t high) {
  PhaseRow row;
  row.workload = "sobel";
  row.unit = unit;
  row.phase = Phase::kCall;
  row.ci_low = Nanos(low);
  row.median = Nanos(median);
  row.ci_high = Nanos(high);
  return row;
}

TEST(Decisions, FindFlipsAndWhetherTheyAreClear) {
  const Profile base = profile_of({call_row("cpu", 90, 100, 110), call_row("gpu", 120, 130, 140)});
  const Profile clear = profile_of({call_row("cpu", 90, 100, 110), call_row("gpu", 60, 70, 80)});
  auto flips = find_flips(base, clear);
  ASSERT_EQ(flips.size(), 1U);
  EXPECT_EQ(flips[0].base, "cpu");
  EXPECT_EQ(flips[0].candidate, "gpu");
  EXPECT_TRUE(flips[0].clear);
  const Profile close = profile_of({call_row("cpu", 90, 100, 110), call_row("gpu", 89, 99, 109)});
  flips = find_flips(base, close);
  ASSERT_EQ(flips.size(), 1U);
  EXPECT_FALSE(flips[0].clear);
  EXPECT_TRUE(find_flips(base, base).empty());
  // One unit is no choice.
  EXPECT_TRUE(find_flips(profile_of({call_row("cpu", 90, 100, 110)}),
                         profile_of({call_row("cpu", 190, 200, 210)}))
                  .empty());
}

GateReport report_of(const Profile& base, const Profile& candidate) {
  GateReport report{.base = "a<b>.db",
                    .candidate = "b.db",
                    .result = judge_both(base, candidate),
                    .decisions = {},
                    .rule = {}};
  report.decisions = Decisions{
      .mix = "full-robot",
      .flips = find_flips(base, candidate),
      .modes = {{.mode = "latency", .base = {}, .candidate = {}, .reason = "not served"}}};
  return report;
}

TEST(GateReport, ShowsWhatMattersAndCountsTheRest) {
  Machine machine(0.005, 0.01, 1);
  const auto report = report_of(profile_of({machine.row("sobel", 10), machine.row("fc6", 20)}),
                                profile_of({machine.row("sobel", 13), machine.row("fc6", 20)}));
  const auto text = render(gate_document(report, false), Format::kText);
  EXPECT_THAT(text, AllOf(HasSubstr("REGRESSION"), HasSubstr("1 slower, 1 same"),
                          HasSubstr("sobel"), Not(HasSubstr("fc6")), HasSubstr("not served")));
  EXPECT_THAT(render(gate_document(report, true), Format::kText), HasSubstr("fc6"));
  EXPECT_THAT(render(gate_document(report, false), Format::kMarkdown), HasSubstr("| sobel"));
  const auto json = gate_json(report);
  EXPECT_EQ(json["exit_code"], 1);
  EXPECT_EQ(json["rows"][0]["verdict"], "slower");
  EXPECT_EQ(json["rows"][0]["workload"], "sobel");
  EXPECT_EQ(json["decisions"]["modes"]["latency"]["reason"], "not served");
}

TEST(GateReport, ShowsAndCountsWhatItCannotTell) {
  Machine exact(0, 0, 1);
  const auto report = report_of(noisy_run(exact, 10), noisy_run(exact, 10));
  EXPECT_THAT(
      render(gate_document(report, false), Format::kText),
      AllOf(HasSubstr("no regression"), HasSubstr("1 rows: 1 cannot tell"), HasSubstr("sobel")));
  EXPECT_THAT(render(gate_document(report, false), Format::kMarkdown), HasSubstr("cannot tell"));
  EXPECT_EQ(gate_json(report)["exit_code"], 0);
  EXPECT_EQ(gate_json(report)["rows"][0]["verdict"], "cannot tell");
  EXPECT_GT(gate_json(report)["rows"][0]["change_at_most"].get<double>(), 0.05);
  EXPECT_THAT(gate_junit(report), AllOf(HasSubstr("failures=\"0\" errors=\"0\" skipped=\"1\""),
                                        HasSubstr("<skipped message=\"cannot tell: ")));
}

TEST(GateReport, SaysOnceWhyModesHaveNoCost) {
  Machine machine(0.005, 0.01, 1);
  const Profile base = profile_of({machine.row("sobel", 10)});
  auto report = report_of(base, profile_of({machine.row("sobel", 10)}));
  report.decisions->modes.push_back(
      {.mode = "energy", .base = {}, .candidate = {}, .reason = "not served"});
  const auto nothing = render(gate_document(report, false), Format::kText);
  EXPECT_THAT(nothing, AllOf(HasSubstr("No cost in latency, energy: not served"),
                             Not(HasSubstr("Virtual time"))));
  RunRecord run;
  run.mean_latency_ms = 12;
  report.decisions->modes.push_back(
      {.mode = "advanced", .base = run, .candidate = run, .reason = ""});
  const auto some = render(gate_document(report, false), Format::kText);
  EXPECT_THAT(some,
              AllOf(HasSubstr("What mix full-robot costs in each mode"), HasSubstr("12.0 -> 12.0"),
                    HasSubstr("latency, energy: not served"), HasSubstr("Virtual time")));
}

TEST(GateReport, WritesJUnitThatEscapesItsTexts) {
  Machine machine(0.005, 0.01, 1);
  const Profile base = profile_of({machine.row("sobel", 10), machine.row("fc6", 20)});
  Profile candidate = profile_of({machine.row("sobel", 13), machine.row("fc6", 20)});
  candidate.phases[1].reasons = {"error: \"<&>\""};
  const auto xml = gate_junit(report_of(base, candidate));
  EXPECT_THAT(xml, AllOf(HasSubstr("<testsuite name=\"cpu\" tests=\"2\" failures=\"1\" "
                                   "errors=\"0\" skipped=\"1\">"),
                         HasSubstr("<failure message=\"slower: "),
                         HasSubstr("&quot;&lt;&amp;&gt;&quot;"), Not(HasSubstr("<&>"))));
}

}  // namespace
}  // namespace pirt::test
