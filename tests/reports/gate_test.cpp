// The gate on two stored profiles: each verdict, and how often it is wrong on simulated runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "reports/gate/gate_report.h"
#include "workloads/base/random.h"

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
    row.valid = true;
    row.ops = 100;
    row.bytes = 10;
    for (int p = 0; p < processes; ++p) {
      const double process_ms = ms * (1 + between_ * normal());
      for (int i = 0; i < samples; ++i) {
        row.values.push_back(from_ms(process_ms * (1 + within_ * std::abs(normal()))));
        row.value_processes.push_back(p);
      }
    }
    auto sorted = row.values;
    std::ranges::sort(sorted);
    row.median = sorted[sorted.size() / 2];
    row.samples = static_cast<std::int64_t>(sorted.size());
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
  EXPECT_LT(*result.rows[0].p, 0.001);
  EXPECT_EQ(result.rows[1].verdict, GateVerdict::kSame);
  EXPECT_EQ(result.rows[2].verdict, GateVerdict::kFaster);
  EXPECT_EQ(result.rows[3].verdict, GateVerdict::kSame) << "2 % are below the effect that counts";
  EXPECT_EQ(exit_code_of(result), 1);
}

TEST(TableGate, LeavesARiseWithinTheNoiseBetweenProcessesOpen) {
  Machine machine(0.06, 0.002, 3);
  const Profile base = profile_of({machine.row("sobel", 10, 5)});
  const Profile candidate = profile_of({machine.row("sobel", 11.2, 5)});
  const auto result = judge_both(base, candidate);
  ASSERT_GT(*result.rows[0].needed, 0.12);
  ASSERT_GT(*result.rows[0].ratio, 1.05);
  EXPECT_EQ(result.rows[0].verdict, GateVerdict::kInconclusive);
  EXPECT_THAT(result.rows[0].reason, HasSubstr("measure again"));
  EXPECT_EQ(exit_code_of(result), 3);
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
  candidate.phases[0].valid = false;
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
  energy.valid = true;
  base.energies = {energy};
  energy.energy_j = 1.3;
  candidate.energies = {energy};
  EXPECT_EQ(judge_both(base, candidate).rows[1].verdict, GateVerdict::kNotJudged);
  base.energies[0].provenance = candidate.energies[0].provenance = Provenance::kMeasured;
  EXPECT_EQ(judge_both(base, candidate).rows[1].verdict, GateVerdict::kSlower);
  candidate.energies[0].energy_j = 1.05;
  EXPECT_EQ(judge_both(base, candidate).rows[1].verdict, GateVerdict::kSame);
}

TEST(TableGate, NoiseIsTheRangeOfProcessMediansOverD2) {
  PhaseRow row;
  row.values = {Nanos(90), Nanos(100), Nanos(110)};
  row.value_processes = {0, 1, 2};
  PhaseRow one = row;
  one.value_processes = {0, 0, 0};
  // 20 / 1.693 / 100; one process says nothing.
  EXPECT_NEAR(*process_noise(row, one), 0.11813, 1e-5);
  EXPECT_NEAR(*process_noise(row, row), 0.11813, 1e-5);
  EXPECT_FALSE(process_noise(one, one));
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

PhaseRow call_row(const std::string& unit, std::int64_t low, std::int64_t median,
                  std::int64_t high) {
  PhaseRow row;
  row.workload = "sobel";
  row.unit = unit;
  row.phase = Phase::kCall;
  row.valid = true;
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

TEST(GateReport, WritesJUnitThatEscapesItsTexts) {
  Machine machine(0.005, 0.01, 1);
  const Profile base = profile_of({machine.row("sobel", 10), machine.row("fc6", 20)});
  Profile candidate = profile_of({machine.row("sobel", 13), machine.row("fc6", 20)});
  candidate.phases[1].valid = false;
  candidate.phases[1].reasons = {"error: \"<&>\""};
  const auto xml = gate_junit(report_of(base, candidate));
  EXPECT_THAT(xml, AllOf(HasSubstr("<testsuite name=\"cpu\" tests=\"2\" failures=\"1\" "
                                   "errors=\"0\" skipped=\"1\">"),
                         HasSubstr("<failure message=\"slower: "),
                         HasSubstr("&quot;&lt;&amp;&gt;&quot;"), Not(HasSubstr("<&>"))));
}

}  // namespace
}  // namespace pirt::test
