// The formats that other tools read: keys, columns, quoting, and that nothing invalid passes for a
// figure.
#include "reports/export/profile_export.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "characterize/profile/store/database_format.h"
#include "characterize/profile/store/sqlite.h"
#include "tests/reports/profiles.h"
#include "tests/support/errors.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

/// Two samples for each of the three rows; sobel's cold preparation is not valid.
Profile small_data() {
  Profile data = test::small_profile(100);
  for (PhaseRow& row : data.phases) {
    row.values = {from_ms(99), from_ms(101)};
    row.value_processes = {0, 1};
  }
  data.phases[0].reasons = {"few_samples", "clock_bound"};
  data.phases[1].notes = {"bimodal"};
  data.energies[0].provenance = Provenance::kModelled;
  PeakRow peak;
  peak.run_id = 1;
  peak.unit = "cpu";
  peak.per_second = 1.5e11;
  peak.variant = "fma";
  data.peaks = {peak};
  return data;
}

TEST(ProfileExport, JsonHoldsEverything) {
  const auto json = export_json(small_data());
  ASSERT_THAT(json["profile_summary"], SizeIs(3));
  const auto& call = json["profile_summary"][1];
  EXPECT_EQ(call["median_ns"], 100'000'000);
  EXPECT_EQ(call["provenance"], "measured");
  EXPECT_EQ(call["samples_ns"], (std::vector{99'000'000, 101'000'000}));
  EXPECT_EQ(call["processes_of_samples"], (std::vector{0, 1}));
  EXPECT_EQ(json["profile_summary"][0]["valid"], false);
  EXPECT_FALSE(json["profile_summary"][0].contains("ci_low_ns"));  // absent, not 0
  EXPECT_EQ(json["energy_summary"][0]["domain"], "unit");
  EXPECT_EQ(json["peaks"][0]["per_second"], 1.5e11);
  EXPECT_EQ(json["runs"][0]["identity"], std::vector<std::string>{"cpu_model"});
  EXPECT_FALSE(json.contains("preferable"));
}

TEST(ProfileExport, CsvHasTheColumnsOfTheViews) {
  const auto data = small_data();
  const auto profile = split(export_csv(data, CsvTable::kProfile), '\n');
  ASSERT_THAT(profile, SizeIs(5));  // header, three rows, and nothing behind the last \n
  EXPECT_EQ(profile[0],
            "run_id,platform,workload,unit,backend,phase,state,provenance,valid,reasons,notes,"
            "samples,median_ns,mad_ns,p95_ns,p99_ns,ci_low_ns,ci_high_ns,ops,bytes,processes,"
            "mixture,bound_ns,cpu_ns,taken,host_memory_bytes,device_memory_bytes,doubts");
  EXPECT_EQ(profile[1],
            "1,board,sobel,cpu,fake,prepare,cold,measured,0,few_samples; clock_bound,,20,"
            "100000000,100000000,100000000,100000000,,,,0,1,0,,,,,,");
  EXPECT_EQ(profile[2],
            "1,board,sobel,cpu,fake,call,steady,measured,1,,bimodal,20,"
            "100000000,100000000,100000000,100000000,98000000,102000000,,0,1,0,,,,,,");
  // A comma inside a field is quoted.
  EXPECT_THAT(split(export_csv(data, CsvTable::kEnergy), '\n'),
              ElementsAre("run_id,workload,unit,energy_j,provenance,source,valid,reasons,domain,"
                          "idle_subtracted,mixture,ci_low_j,ci_high_j,doubts",
                          "1,sobel,cpu,0.1,modelled,\"model: active_w 1 W x call, guessed\",1,,"
                          "unit,0,0,,,",
                          ""));
  EXPECT_THAT(split(export_csv(data, CsvTable::kPeaks), '\n'),
              ElementsAre("run_id,unit,kind,per_second,variant,provenance,valid,reasons,doubts",
                          "1,cpu,f32,150000000000,fma,measured,1,,", ""));
  const auto samples = split(export_csv(data, CsvTable::kSamples), '\n');
  ASSERT_THAT(samples, SizeIs(8));
  EXPECT_EQ(samples[0], "run_id,workload,unit,phase,state,provenance,valid,position,process,ns");
  EXPECT_EQ(samples[2], "1,sobel,cpu,prepare,cold,measured,0,1,1,101000000");
}

TEST(ProfileExport, CsvHasTheViewsColumnsInTheirOrder) {
  sqlite::Connection schema("schema", sqlite::Connection::Mode::kMemory, Nanos(0));
  schema.run(std::string(database_schema()));
  for (const auto& [view, table] : {std::pair("profile_summary", CsvTable::kProfile),
                                    std::pair("condition_summary", CsvTable::kConditions),
                                    std::pair("unit_time_summary", CsvTable::kUnitTimes),
                                    std::pair("energy_summary", CsvTable::kEnergy)}) {
    std::vector<std::string> columns;
    sqlite::Statement query(schema, fmt::format("SELECT name FROM pragma_table_info('{}')", view));
    while (query.step()) columns.push_back(query.text(0));
    EXPECT_EQ(split(export_csv(small_data(), table), '\n').front(), join(columns, ",")) << view;
  }
}

TEST(ProfileExport, CsvQuotesQuotesAndLineBreaks) {
  auto data = small_data();
  data.energies[0].source = "a \"meter\"\nof mine";
  EXPECT_THAT(export_csv(data, CsvTable::kEnergy), HasSubstr(",\"a \"\"meter\"\"\nof mine\","));
}

TEST(ProfileExport, GoogleBenchmarkHasAnEntryASampleAndAggregates) {
  const auto result = export_google_benchmark(small_data());
  const auto& entries = result.json["benchmarks"];
  ASSERT_THAT(entries, SizeIs(2 * (2 + 4)));  // sobel's and fc8's calls
  const auto& second = entries[1];
  EXPECT_EQ(second["name"], "sobel/cpu/call/real_time");
  EXPECT_EQ(second["run_name"], second["name"]);
  EXPECT_EQ(second["run_type"], "iteration");
  EXPECT_EQ(second["repetition_index"], 1);
  EXPECT_EQ(second["real_time"], 101'000'000);
  EXPECT_EQ(second["cpu_time"], second["real_time"]);
  EXPECT_EQ(second["time_unit"], "ns");
  EXPECT_EQ(second["label"], "measured; bimodal");
  const auto& median = entries[2];
  EXPECT_EQ(median["name"], "sobel/cpu/call/real_time_median");
  EXPECT_EQ(median["run_name"], "sobel/cpu/call/real_time");
  EXPECT_EQ(median["run_type"], "aggregate");
  EXPECT_EQ(median["aggregate_name"], "median");
  EXPECT_EQ(median["real_time"], 100'000'000);
  EXPECT_EQ(result.json["context"]["pirt_cpu_model"], "Some CPU");
}

TEST(ProfileExport, GoogleBenchmarkLeavesOutWhatIsNotValid) {
  const auto result = export_google_benchmark(small_data());
  EXPECT_THAT(result.left_out,
              ElementsAre("sobel/cpu/prepare_cold/real_time: few_samples, clock_bound"));
  EXPECT_EQ(result.json["context"]["pirt_left_out"], result.left_out);
  EXPECT_EQ(json_text(result.json["benchmarks"]).find("prepare"), std::string::npos);
}

TEST(ProfileExport, GoogleBenchmarkHasWhatIsDoubtedAndSaysSo) {
  Profile data = small_data();
  data.phases[1].doubts = {"contended"};
  const auto result = export_google_benchmark(data);
  EXPECT_THAT(result.left_out, SizeIs(1)) << "as without the doubt";
  EXPECT_EQ(result.json["benchmarks"][0]["name"], "sobel/cpu/call/real_time");
  EXPECT_EQ(result.json["benchmarks"][0]["doubts"], std::vector<std::string>{"contended"});
}

TEST(ProfileExport, KeepsTheWorkloadsOfAFilter) {
  auto profile = test::small_profile(1);
  keep_workloads(profile, "^fc");
  EXPECT_THAT(profile.workloads(), ElementsAre("fc8"));
  EXPECT_TRUE(profile.energies.empty());
  EXPECT_THAT(test::bad_input([&] { keep_workloads(profile, "fc9"); }),
              AllOf(HasSubstr("'fc9'"), HasSubstr("fc8")));
  EXPECT_THAT(test::bad_input([&] { keep_workloads(profile, "("); }),
              HasSubstr("not a regular expression"));
}

}  // namespace
}  // namespace pirt
