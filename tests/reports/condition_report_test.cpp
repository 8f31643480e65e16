// Rows of other conditions and hand-overs: in tables of their own, and in no other.
#include "reports/profile/condition_report.h"

#include <gmock/gmock.h>

#include "reports/export/profile_export.h"
#include "reports/profile/profile_diff.h"
#include "reports/profile/profile_report.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

PhaseRow execute(Condition condition, double ms) {
  PhaseRow row;
  row.run_id = 1;
  row.platform = "board";
  row.workload = "sobel";
  row.unit = "cpu";
  row.backend = "cpu";
  row.phase = Phase::kExecute;
  row.condition = condition;
  row.samples = 20;
  row.processes = 4;
  row.median = row.mad = row.p95 = row.p99 = from_ms(ms);
  row.ci_low = from_ms(0.9 * ms);
  row.ci_high = from_ms(1.1 * ms);
  row.values = {from_ms(ms)};
  row.value_processes = {0};
  return row;
}

Profile profile_of(double cold_ms) {
  Profile profile;
  profile.path = "p.db";
  profile.runs = {{.run_id = 1,
                   .started = "2024-01-02T03:04:05Z",
                   .finished = "2024-01-02T03:05:05Z",
                   .platform = "board",
                   .seed = 1,
                   .environment = {},
                   .units = {{"cpu", "cpu", "some", true, {0}}}}};
  profile.phases = {execute(Condition::kSteady, 2)};
  profile.conditions = {execute(Condition::kColdCache, cold_ms)};
  profile.conditions.push_back(execute(Condition::kBesideMemory, 3));
  profile.conditions.back().reasons = {"few_samples"};
  UnitTimeRow handover;
  handover.run_id = 1;
  handover.unit = handover.backend = "cpu";
  handover.sleep = from_ms(10);
  handover.samples = 10;
  handover.median = handover.mad = handover.p95 = handover.p99 = Nanos(71'000);
  handover.values = {Nanos(70'000), Nanos(72'000)};
  profile.unit_times = {handover};
  return profile;
}

TEST(ConditionReport, HasARowOfEachConditionBesideSteady) {
  const auto table = condition_table(profile_of(5)).value();
  ASSERT_THAT(table.rows, SizeIs(1));
  EXPECT_THAT(table.rows[0], ElementsAre("sobel", "cpu", "2.00", "5.00", "2.50x", "invalid", "-",
                                         "beside_memory, INVALID: few_samples"));
  EXPECT_EQ(table.columns[3].header, "cold cache");
  const auto handovers = unit_time_table(profile_of(5)).value();
  EXPECT_THAT(handovers.rows[0], ElementsAre("cpu", "handing over a call, asleep for 10.0 ms",
                                             "71.0", "71.0", "71.0", "10", ""));
  EXPECT_THAT(condition_tables({}), IsEmpty());
}

TEST(ConditionReport, TheProfileTableKnowsOnlySteadyRows) {
  const Profile profile = profile_of(5);
  const auto table = profile_table(profile);
  EXPECT_THAT(render({.parts = {table}}, Format::kText), Not(HasSubstr("5.00")));
  const Json json = profile_json(profile, {});
  EXPECT_THAT(json["profile_summary"], SizeIs(1));
  EXPECT_EQ(json["profile_summary"][0]["median_ns"], 2'000'000);
  EXPECT_EQ(json["condition_summary"][0]["state"], "cold_cache");
  EXPECT_EQ(json["unit_time_summary"][0]["sleep_ns"], 10'000'000);
  EXPECT_EQ(json["unit_time_summary"][0]["backend"], "cpu");
}

TEST(ConditionReport, AreExportedApart) {
  const Profile profile = profile_of(5);
  const Json json = export_json(profile);
  EXPECT_EQ(json["condition_summary"][0]["samples_ns"], std::vector{5'000'000});
  EXPECT_EQ(json["unit_time_summary"][0]["samples_ns"], (std::vector{70'000, 72'000}));
  EXPECT_THAT(export_csv(profile, CsvTable::kProfile), Not(HasSubstr("cold_cache")));
  EXPECT_THAT(export_csv(profile, CsvTable::kSamples), Not(HasSubstr("5000000")));
  EXPECT_THAT(export_csv(profile, CsvTable::kConditions),
              HasSubstr("\n1,board,sobel,cpu,cpu,execute,cold_cache,measured,1,,,20,5000000,"));
  EXPECT_THAT(export_csv(profile, CsvTable::kUnitTimes),
              HasSubstr("\n1,board,cpu,cpu,handover,10000000,measured,1,,10,71000,"));
  EXPECT_THAT(export_google_benchmark(profile).json["benchmarks"], SizeIs(5));
}

TEST(ConditionReport, AreComparedWithTheirLike) {
  const Profile a = profile_of(5);
  const Profile b = profile_of(6);
  const ProfileDiff diff = diff_profiles(a, b);
  EXPECT_THAT(diff.phases, SizeIs(1));
  ASSERT_THAT(diff.conditions, SizeIs(2));
  EXPECT_DOUBLE_EQ(diff.conditions[0].ratio().value(), 1.2);
  EXPECT_DOUBLE_EQ(diff.unit_times.at(0).ratio().value(), 1);
  EXPECT_THAT(render(diff_document(diff), Format::kText), HasSubstr("execute cold_cache"));
  const Json json = diff_json(diff);
  EXPECT_EQ(json["figures"].size(), 1U);
  EXPECT_EQ(json["conditions"][0]["state"], "cold_cache");
}

}  // namespace
}  // namespace pirt
