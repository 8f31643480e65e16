// What the gate says of two stored profiles, to people and programs, and which decisions changed.
#include "reports/gate/gate_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/reports/gate_runs.h"
#include "workloads/base/text/json.h"

namespace pirt::test {
namespace {

using testing::_;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

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

// As a run on another day may be, where nothing was changed.
TEST(GateReport, SaysWhereTooFewWorkloadsTellHowRunsDiffer) {
  const auto notes_of = [](double slower, int workloads, int runs) {
    Machine exact(0, 0, 1);
    const auto run = [&](double factor) {
      std::vector<PhaseRow> rows;
      for (int i = 0; i < workloads; ++i) {
        rows.push_back(exact.row("w" + std::to_string(i), i == 0 ? 10 * factor : 10));
        if (runs > 1) rows.back().pooled_runs = {1};
      }
      return profile_of(std::move(rows));
    };
    GateReport report;
    report.result = judge_both(run(1), run(slower));
    EXPECT_EQ(report.result.count(GateVerdict::kSlower), slower > 1 ? 1 : 0);
    describe_rule(GateThresholds{}, report);
    return report.notes;
  };
  EXPECT_THAT(notes_of(1.15, 3, 1),
              ElementsAre(_, AllOf(HasSubstr("Slower on cpu may be one run"),
                                   HasSubstr("fewer than 6 workloads"), HasSubstr("same --db"))));
  EXPECT_EQ(notes_of(1, 3, 1).size(), 1U) << "nothing is slower";
  EXPECT_EQ(notes_of(1.15, 6, 1).size(), 1U) << "the others tell";
  EXPECT_EQ(notes_of(1.15, 3, 2).size(), 1U) << "two runs tell";
}

// The newest run of the file is one moment of three; another may have been a busy one.
TEST(GateReport, ARowIsHeldAgainstThePeaksOfItsOwnRuns) {
  Profile base = profile_of({with_interval(10, 0.01)});
  base.peaks = {peak(PeakKind::kF32, 200e9)};
  Profile candidate = profile_of({with_interval(12, 0.01)});
  candidate.runs = {candidate.runs[0], candidate.runs[0]};
  candidate.runs[0].run_id = 3;
  candidate.runs[1].run_id = 2;
  candidate.peaks = {peak(PeakKind::kF32, 160e9, 3)};
  candidate.earlier_peaks = {peak(PeakKind::kF32, 200e9, 2), peak(PeakKind::kF32, 200e9, 1)};
  PhaseRow& row = candidate.phases[0];
  const auto verdict = [&](std::int64_t run, std::vector<std::int64_t> pooled) {
    row.run_id = run;
    row.pooled_runs = std::move(pooled);
    return judge_both(base, candidate).rows[0].verdict;
  };
  EXPECT_EQ(verdict(3, {}), GateVerdict::kUndecided) << "a fifth less";
  EXPECT_EQ(verdict(2, {}), GateVerdict::kSlower);
  EXPECT_EQ(verdict(3, {2, 1}), GateVerdict::kSlower) << "the median of the three";
  // Rows of two runs.
  candidate.phases[0].pooled_runs.clear();
  for (Profile* profile : {&base, &candidate}) {
    profile->phases.push_back(profile->phases[0]);
    profile->phases[1].workload = "fc6";
  }
  candidate.phases[1].run_id = 2;
  GateReport report;
  report.result = judge_both(base, candidate);
  describe_rule(GateThresholds{}, report);
  EXPECT_THAT(report.notes[0], HasSubstr("by its own peaks: cpu f32 -20.0 to +0.0 %."));
}

TEST(GateReport, SaysWhatWasTakenOffAgainstTheAnchorAndWhereOneRunIsTooFew) {
  const auto run = [](double ms, double f32) {
    Profile profile = profile_of({with_interval(ms, 0.01)});
    profile.peaks = {peak(PeakKind::kF32, f32)};
    return profile;
  };
  const Profile candidate = run(14, 200e9);
  GateReport report;
  report.anchor = "old.db";
  report.result = judge_both(run(14, 200e9), candidate);
  add_anchor(judge_both(run(10, 240e9), candidate), report.result);
  describe_rule(GateThresholds{}, report);
  EXPECT_EQ(exit_code_of(report.result), 1);
  EXPECT_THAT(report.notes, ElementsAre(HasSubstr("own peaks: cpu f32 +0.0 %."),
                                        HasSubstr("against the anchor: cpu f32 -16.7 %."),
                                        HasSubstr("Slower on cpu may be one run")));
  EXPECT_NEAR(gate_json(report)["anchor_machine"][0]["ratio"].get<double>(), 200.0 / 240, 1e-9);
}

TEST(GateReport, NamesAndCountsWhatIsUndecided) {
  const Profile wide = profile_of({with_interval(10, 0.08)});
  auto report = report_of(wide, wide);
  EXPECT_THAT(
      render(gate_document(report, false), Format::kText),
      AllOf(HasSubstr("UNDECIDED in 1 of 1 rows, none slower"), Not(HasSubstr("regression:")),
            HasSubstr("1 rows: 1 undecided"), HasSubstr("sobel")));
  EXPECT_EQ(gate_json(report)["exit_code"], 0);
  EXPECT_EQ(gate_json(report)["rows"][0]["verdict"], "undecided");
  EXPECT_GT(gate_json(report)["rows"][0]["change_at_most"].get<double>(), 0.05);
  EXPECT_THAT(gate_junit(report), AllOf(HasSubstr("failures=\"0\" errors=\"0\" skipped=\"1\""),
                                        HasSubstr("<skipped message=\"undecided: ")));
  report.strict = true;
  EXPECT_THAT(render(gate_document(report, false), Format::kText), HasSubstr("INCONCLUSIVE"));
  EXPECT_EQ(gate_json(report)["exit_code"], 3);
}

TEST(GateReport, CountsSetUpsThatAreNotJudgedApart) {
  Machine machine(0.005, 0.01, 1);
  const Profile run = profile_of(
      {machine.row("sobel", 10), machine.row("sobel", 10, 2, 1, Phase::kPrepare, State::kCold)});
  EXPECT_THAT(render(gate_document(report_of(run, run), false), Format::kText),
              HasSubstr("2 rows: 1 same, 1 not judged (1 of set-up)"));
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
  const Json modes = gate_json(report)["decisions"]["modes"];
  EXPECT_EQ(modes["advanced"]["base"]["mean_latency_ms"], 12);
  EXPECT_FALSE(modes["advanced"]["base"].contains("energy_j")) << "nobody knows it";
}

TEST(GateReport, WritesJUnitThatEscapesItsTexts) {
  Machine machine(0.005, 0.01, 1);
  const Profile base = profile_of({machine.row("sobel", 10), machine.row("fc6", 20)});
  Profile candidate = profile_of({machine.row("sobel", 13), machine.row("fc6", 20)});
  candidate.phases[1].reasons = {"error: \"<&>\""};
  candidate.phases[1].notes = {};
  const auto xml = gate_junit(report_of(base, candidate));
  EXPECT_THAT(xml, AllOf(HasSubstr("<testsuite name=\"cpu\" tests=\"2\" failures=\"1\" "
                                   "errors=\"0\" skipped=\"1\">"),
                         HasSubstr("<failure message=\"slower: "),
                         HasSubstr("&quot;&lt;&amp;&gt;&quot;"), Not(HasSubstr("<&>"))));
}

}  // namespace
}  // namespace pirt::test
