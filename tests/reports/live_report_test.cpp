// A live run beside virtual time: which run predicts it, how far off it was, and which rows of the
// profile it contradicts.
#include "reports/run/live_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "reports/run/run_report.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/shell.h"

namespace pirt {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

/// 20 Hz at 10 ms with half of the unit busy.
RunRecord run_of(const std::string& time) {
  RunRecord run;
  run.mode = "throughput";
  run.platform = "board";
  run.mix = "small";
  run.time = time;
  run.duration_s = 10.0;
  UnitResult cpu;
  cpu.unit = "cpu";
  cpu.role = "cpu";
  cpu.backend = "cpu";
  cpu.provenance = {"measured"};
  cpu.completed = 200;
  cpu.utilization = 0.5;
  UnitResult paced = cpu;
  paced.unit = "dsp";
  paced.backend.reset();
  paced.provenance = {"modelled"};
  run.units = {cpu, paced};
  PipelineResult pipeline;
  pipeline.pipeline = "vision";
  pipeline.rate_hz = 20;
  pipeline.p50_ms = 10;
  pipeline.p95_ms = 16;
  run.pipelines = {pipeline};
  run.calls = {{"sobel", "cpu", 200, 10, 16}, {"sobel", "dsp", 200, 10, 16}};
  return run;
}

/// The row's median is between 9 and 11 ms: 10 % more, 8.18 to 12.1 ms.
Profile profile() {
  Profile profile;
  profile.path = "p.db";
  RunInfo run;
  run.platform = "board";
  profile.runs = {run};
  PhaseRow row;
  row.workload = "sobel";
  row.unit = "cpu";
  row.median = from_ms(10);
  row.ci_low = from_ms(9);
  row.ci_high = from_ms(11);
  profile.phases = {row};
  return profile;
}

RowFinding finding_of(double p50_ms, std::int64_t calls, const Profile* of) {
  auto live = run_of("live");
  live.calls = {{"sobel", "cpu", calls, p50_ms, p50_ms}};
  return check_rows(live, of).at(0).finding;
}

template <typename T>
std::vector<T> all_of(const std::vector<Part>& parts) {
  std::vector<T> found;
  for (const Part& part : parts) {
    if (const auto* each = std::get_if<T>(&part)) found.push_back(*each);
  }
  return found;
}

TEST(LiveReport, PairsALiveRunWithThoseThatPredictIt) {
  auto drawn = run_of("virtual"), other = run_of("virtual"), shorter = run_of("virtual");
  drawn.draw = "samples";
  other.mode = "latency";
  shorter.duration_s = 5.0;
  const std::vector<RunRecord> runs = {run_of("virtual"), other,          run_of("live"),
                                       shorter,           run_of("live"), drawn};
  const auto found = live_runs(runs);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].live, &runs[2]);
  EXPECT_EQ(found[0].predictions, (std::vector<const RunRecord*>{&runs[0], &runs[5]}));
}

TEST(LiveReport, WhatWasAskedForOtherwiseIsNoPrediction) {
  RunRecord live = run_of("live");
  live.mode = "budget";
  live.objective = "energy";
  live.profile = "p.db";
  live.profile_file = "/robot/p.db";
  live.profile_hash = "1";
  const auto predictions = [&live](RunRecord virtual_run) {
    virtual_run.time = "virtual";
    const std::vector<RunRecord> runs = {live, virtual_run};
    return live_runs(runs).at(0).predictions.size();
  };
  EXPECT_EQ(predictions(live), 1U);
  RunRecord other = live;
  other.objective = "rate";
  EXPECT_EQ(predictions(other), 0U);
  other = live;
  other.power_cap_w = 6.0;
  EXPECT_EQ(predictions(other), 0U);
  other = live;
  other.besides = {"--without dsp"};
  EXPECT_EQ(predictions(other), 0U);
  other = live;
  other.profile_hash = "2";
  EXPECT_EQ(predictions(other), 1U) << "the database has got rows since";
  other.profile_file = "/other/p.db";
  EXPECT_EQ(predictions(other), 0U);
}

TEST(LiveReport, SaysHowFarVirtualTimeIsOff) {
  auto predicted = run_of("virtual");
  predicted.pipelines[0].rate_hz = 22;    // +10 %
  predicted.pipelines[0].p50_ms = 8;      // -20 %
  predicted.pipelines[0].p95_ms.reset();  // none completed
  predicted.units[0].utilization = 0.45;  // 5 points less
  const std::vector<RunRecord> runs = {run_of("live"), predicted};
  const auto measured = profile();
  const std::vector<const Profile*> profiles = {&measured};
  const auto parts = live_parts(runs, profiles);
  const auto charts = all_of<Chart>(parts);
  ASSERT_EQ(charts.size(), 1U);
  using Row = std::vector<std::string>;
  // A paced unit was used: its figures are modelled, and so is what rests on them.
  EXPECT_EQ(charts[0].table.rows[0], (Row{"vision", "rate Hz", "~20.0", "~22.0", "+10.0"}));
  EXPECT_EQ(charts[0].table.rows[1], (Row{"vision", "p50 ms", "~10.0", "~8.00", "-20.0"}));
  EXPECT_EQ(charts[0].table.rows[2], (Row{"vision", "p95 ms", "~16.0", "-", "-"}));
  ASSERT_EQ(charts[0].marks.size(), 3U);
  EXPECT_NEAR(*charts[0].marks[0].x, 10, 1e-9);
  EXPECT_FALSE(charts[0].marks[2].x);
  EXPECT_NE(charts[0].marks[2].word, "");
  const auto units = all_of<Table>(parts).at(0);
  EXPECT_EQ(units.rows[0], (Row{"cpu", "200", "200", "50.0", "~45.0", "-5.0"}));
  EXPECT_EQ(units.rows[1], (Row{"dsp", "200", "200", "~50.0", "~50.0", "+0.0"}));
  const auto json = live_json(runs, profiles);
  ASSERT_EQ(json.size(), 1U);
  const auto& prediction = json[0]["predictions"][0];
  EXPECT_NEAR(prediction["pipelines"]["vision"]["p50_ms_error"].get<double>(), -0.2, 1e-9);
  EXPECT_FALSE(prediction["pipelines"]["vision"].contains("p95_ms_error"));
  EXPECT_NEAR(prediction["units"]["cpu"]["utilization_error"].get<double>(), -0.05, 1e-9);
}

TEST(LiveReport, NamesWhatVirtualTimeLeavesOutAndWhatIsMissing) {
  const std::vector<RunRecord> runs = {run_of("live")};
  const Document document{.title = "t", .parts = live_parts(runs, {})};
  const auto text = render(document, Format::kText);
  for (const char* part : {"cold caches", "memory bandwidth", "dispatcher", "operating system"}) {
    EXPECT_THAT(text, HasSubstr(part));
  }
  EXPECT_THAT(text, HasSubstr("pirt schedule --mode throughput --platform board --mix small "
                              "--duration 10s --seed 1 --json virtual.json"));
  RunRecord asked = run_of("live");
  asked.objective = "energy";
  asked.power_cap_w = 7.5;
  asked.draw = "p95";
  asked.duration_s = 2.013712345;  // It was stopped.
  EXPECT_THAT(render({.title = "t", .parts = live_parts(std::vector{asked}, {})}, Format::kText),
              HasSubstr("--duration 2.013712345s --objective energy --power-cap 7.5W --draw p95 "
                        "--seed 1 --json"));
  EXPECT_TRUE(live_parts(std::vector{run_of("virtual")}, {}).empty());
}

TEST(LiveReport, WhatMakesThePredictionHoldsInAnyFolder) {
  RunRecord live = run_of("live");
  live.profile = "p.db";
  live.platform_file = "/robots/my board.yaml";
  live.mix_file = "/robots/small.yaml";
  EXPECT_THAT(
      render({.title = "t", .parts = live_parts(std::vector{live}, {})}, Format::kText),
      HasSubstr("--profile " + path_in_shell(std::filesystem::absolute("p.db").string()) +
                " --platform '/robots/my board.yaml' --mix /robots/small.yaml --duration 10s"));
  // It is the same mix, wherever its file is.
  RunRecord predicted = run_of("virtual");
  predicted.profile = "p.db";
  predicted.mix_file = "/elsewhere/small.yaml";
  const std::vector<RunRecord> runs = {live, predicted};
  EXPECT_EQ(live_runs(runs).at(0).predictions.size(), 1U);
  EXPECT_TRUE(ran_the_same(live, predicted));
}

TEST(LiveReport, ARowIsContradictedFarFromTheIntervalOfItsMedian) {
  const auto measured = profile();
  EXPECT_EQ(finding_of(8.2, 200, &measured), RowFinding::kAgrees);
  EXPECT_EQ(finding_of(12, 200, &measured), RowFinding::kAgrees);
  EXPECT_EQ(finding_of(12.2, 200, &measured), RowFinding::kContradicted);
  EXPECT_EQ(finding_of(8.1, 200, &measured), RowFinding::kContradicted);
  EXPECT_EQ(finding_of(12.2, kFewestCalls - 1, &measured), RowFinding::kTooFewCalls);
  EXPECT_EQ(finding_of(10, 200, nullptr), RowFinding::kNoRow);
  auto invalid = profile();
  invalid.phases[0].reasons = {"wrong_output"};
  EXPECT_EQ(finding_of(10, 200, &invalid), RowFinding::kNoRow);
}

TEST(LiveReport, ChecksRowsOfUnitsThatComputed) {
  const auto measured = profile();
  const auto rows = check_rows(run_of("live"), &measured);
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0].live.unit, "cpu");
}

TEST(LiveReport, ARowByTheUnitsOwnClockIsNotContradictedByTheMachines) {
  const auto measured = profile();
  auto live = run_of("live");
  ASSERT_FALSE(live.calls.empty());
  for (CallResult& call : live.calls) call.p50_ms = 100;
  EXPECT_EQ(check_rows(live, &measured).at(0).finding, RowFinding::kContradicted);
  for (UnitResult& unit : live.units) unit.own_clock = true;
  EXPECT_EQ(check_rows(live, &measured).at(0).finding, RowFinding::kOwnClock);
}

TEST(LiveReport, ALiveRunBesideAnotherInVirtualTimeIsNoMistake) {
  const std::vector<RunRecord> runs = {run_of("live"), run_of("virtual")};
  const auto table = modes_table(runs);
  EXPECT_THAT(table.title, HasSubstr("virtual and live time"));
  EXPECT_EQ(table.columns[1].header, "throughput, live");
  EXPECT_EQ(table.columns[2].header, "throughput, virtual");
  EXPECT_THAT(table.footnotes, Not(Contains(HasSubstr("NOT COMPARABLE"))));
}

TEST(LiveReport, WhatTheClockSaidIsMeasured) {
  auto live = run_of("live");
  EXPECT_EQ(time_of(live, live.units[0]), Provenance::kMeasured);
  EXPECT_EQ(time_of(live, live.units[1]), Provenance::kModelled);
  EXPECT_EQ(marks_of(live).time, Provenance::kModelled);
  live.units.pop_back();
  EXPECT_EQ(marks_of(live).time, Provenance::kMeasured);
  EXPECT_EQ(marks_of(run_of("virtual")).time, Provenance::kModelled);
}

}  // namespace
}  // namespace pirt
