// Figures that repeat exactly, mixtures and bounds in gate, report and export.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "reports/document/figures.h"
#include "reports/export/profile_export.h"
#include "reports/gate/table_gate.h"
#include "reports/profile/offloading.h"
#include "reports/profile/profile_report.h"
#include "workloads/base/text/json.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

PhaseRow row(Phase phase, State state, std::int64_t ns, Origin origin) {
  PhaseRow row;
  row.run_id = 1;
  row.platform = "board";
  row.workload = "sobel";
  row.unit = "dsp";
  row.backend = "fake";
  row.phase = phase;
  row.state = state;
  row.provenance = origin;
  row.notes = {std::string(kDeterministic)};
  row.samples = row.processes = 1;
  row.values = {Nanos(ns)};
  row.value_processes = {0};
  row.median = row.ci_low = row.ci_high = row.mean = Nanos(ns);
  return row;
}

Profile profile_of(std::vector<PhaseRow> rows) {
  Profile profile;
  profile.path = "p.db";
  RunInfo run;
  run.run_id = 1;
  run.platform = "board";
  run.units = {{"dsp", "fake", "counted", false, {}}};
  profile.runs = {run};
  profile.phases = std::move(rows);
  return profile;
}

PhaseRow unknown(Phase phase, State state) {
  PhaseRow absent = row(phase, state, 0, Provenance::kCounted);
  absent.reasons = {"unknown: loading is not modelled"};
  absent.samples = absent.processes = 0;
  absent.values.clear();
  absent.value_processes.clear();
  absent.median = absent.ci_low = absent.ci_high = absent.mean = std::nullopt;
  return absent;
}

Profile counted(std::int64_t execute_ns) {
  PhaseRow execute = row(Phase::kExecute, State::kSteady, execute_ns, Provenance::kCounted);
  execute.bound = Nanos(1'000'000);
  return profile_of({row(Phase::kDeviceInit, State::kCold, 500'000, Provenance::kCounted),
                     unknown(Phase::kPrepare, State::kCold), std::move(execute),
                     row(Phase::kCall, State::kSteady, execute_ns + 300'000,
                         Origin(Provenance::kPublished, true))});
}

GateVerdict verdict_of(std::int64_t base_ns, std::int64_t candidate_ns) {
  const Profile base = counted(base_ns);
  const Profile candidate = counted(candidate_ns);
  const GateResult result = judge(diff_profiles(base, candidate));
  return std::ranges::find(result.rows, "execute", &GateRow::phase)->verdict;
}

TEST(ForeignGate, CountsAreJudgedToTheNanosecond) {
  EXPECT_EQ(verdict_of(2'000'000, 2'000'000), GateVerdict::kSame);
  EXPECT_EQ(verdict_of(2'000'000, 2'000'001), GateVerdict::kSlower);
  EXPECT_EQ(verdict_of(2'000'000, 1'999'999), GateVerdict::kFaster);
}

TEST(ForeignGate, WhatNobodyKnowsOnBothSidesIsNotJudged) {
  const Profile base = counted(2'000'000);
  const GateResult result = judge(diff_profiles(base, base));
  const auto prepare = std::ranges::find(result.rows, "prepare cold", &GateRow::phase);
  EXPECT_EQ(prepare->verdict, GateVerdict::kNotJudged);
  EXPECT_EQ(prepare->reason, "no figure on either side: unknown: loading is not modelled");
}

TEST(ForeignGate, SaysByHowMuchACountMoved) {
  const Profile base = counted(2'000'000);
  const Profile candidate = counted(2'000'007);
  const GateResult result = judge(diff_profiles(base, candidate));
  EXPECT_EQ(std::ranges::find(result.rows, "execute", &GateRow::phase)->reason,
            "it repeats exactly, and is 7 ns more");
}

TEST(ForeignReport, MarksMixturesBehindTheWeakestMark) {
  EXPECT_EQ(marked("1.2", Origin(Provenance::kPublished, true)), "+*1.2");
  EXPECT_EQ(marked("1.2", Provenance::kCounted), "#1.2");
  EXPECT_THAT(std::string(provenance_legend()), HasSubstr("* a sum"));
  const std::string text = render({.parts = {profile_table(counted(2'000'000))}}, Format::kText);
  EXPECT_THAT(
      text,
      AllOf(HasSubstr("+*2.30"), HasSubstr("#2.00"), HasSubstr("execute at least 1.00 ms"),
            HasSubstr("unknown: loading is not modelled (prepare)"), Not(HasSubstr("INVALID"))));
}

TEST(ForeignReport, SetUpCostsSayWhichPhaseIsNotKnown) {
  const OffloadingCosts costs = offloading_costs(counted(2'000'000));
  ASSERT_FALSE(costs.missing.empty());
  EXPECT_EQ(costs.missing[0].reason, "prepare is unknown: loading is not modelled");
}

TEST(ForeignReport, SetUpCostsOfSeveralProvenancesAreMixtures) {
  const OffloadingCosts costs = offloading_costs(
      profile_of({row(Phase::kDeviceInit, State::kCold, 1000, Provenance::kMeasured),
                  row(Phase::kPrepare, State::kCold, 1000, Provenance::kMeasured),
                  row(Phase::kCall, State::kSteady, 1000, Provenance::kCounted)}));
  ASSERT_EQ(costs.costs.size(), 1U);
  EXPECT_EQ(costs.costs[0].provenance, Origin(Provenance::kCounted, true));
}

TEST(ForeignExport, HasMixtureAndBound) {
  const std::string csv = export_csv(counted(2'000'000), CsvTable::kProfile);
  EXPECT_THAT(csv, AllOf(HasSubstr("processes,mixture,bound_ns,"), HasSubstr(",1,0,1000000,"),
                         HasSubstr(",1,1,,")));
}

}  // namespace
}  // namespace pirt::test
