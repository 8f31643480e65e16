// What is said of runs: counts, marks that tell computed from measured, runs that cannot be
// compared.
#include "reports/run/run_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "reports/run/what_if_report.h"

namespace pirt {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

RunRecord run_of(const std::string& mode) {
  RunRecord run;
  run.mode = mode;
  run.platform = "host";
  run.mix = "small";
  run.makespan_s = 2;
  run.submitted = 5;
  run.completed = 4;
  run.dropped = 1;
  run.mean_latency_ms = 3.0;
  run.energy_j = 7;
  UnitResult cpu;
  cpu.unit = "cpu";
  cpu.role = "cpu";
  cpu.device = "Some CPU";
  cpu.provenance = {"measured"};
  cpu.energy_provenance = {"modelled"};
  cpu.completed = 4;
  cpu.mean_latency_ms = 3.0;
  run.units = {cpu};
  PipelineResult pipeline;
  pipeline.pipeline = "vision";
  pipeline.fired = 5;
  pipeline.completed = 4;
  run.pipelines = {pipeline};
  run.weights = {{"sobel", {{"cpu", 3}}}};
  return run;
}

std::vector<std::string> row_of(const Table& table, const std::string& name) {
  for (const auto& row : table.rows) {
    if (row[0] == name) return row;
  }
  ADD_FAILURE() << "no row " << name;
  return {};
}

TEST(WhatIfReport, SaysOnceWhatSeveralModesWarnOf) {
  WhatIf found;
  const std::string warning = "fc8 on gpu is not used: its call row is invalid (wrong_output)";
  for (const char* mode : {"edf", "budget"}) {
    found.rows.push_back({.mode = mode, .warnings = {warning}});
  }
  const auto document = what_if_document(found, Platform{}, Mix{});
  const auto& notes = std::get<Table>(document.parts.at(1)).footnotes;
  EXPECT_EQ(std::ranges::count(notes, "Note: " + warning), 1);
}

TEST(ModesTable, HasAColumnARun) {
  const std::vector<RunRecord> runs = {run_of("latency"), run_of("energy")};
  const auto table = modes_table(runs);
  ASSERT_EQ(table.columns.size(), 3U);
  EXPECT_EQ(table.columns[2].header, "energy");
  for (const auto& row : table.rows) EXPECT_EQ(row.size(), 3U);
  EXPECT_EQ(row_of(table, "completed")[1], "4");
  EXPECT_THAT(table.footnotes, Not(Contains(HasSubstr("NOT COMPARABLE"))));
}

TEST(ModesTable, WhatVirtualTimeComputesFromMeasurementsIsModelled) {
  const std::vector<RunRecord> runs = {run_of("latency")};
  const auto table = modes_table(runs);
  EXPECT_EQ(row_of(table, "task latency, mean ms")[1], "~3.00");
  EXPECT_EQ(row_of(table, "energy, J")[1], "~7.00");
}

TEST(ModesTable, WhatRestsOnFittedInputsIsFitted) {
  auto run = run_of("latency");
  run.units[0].provenance = {"fitted"};
  run.units[0].energy_provenance = {"fitted"};
  const std::vector<RunRecord> runs = {run};
  EXPECT_EQ(row_of(modes_table(runs), "task latency, mean ms")[1], "^3.00");
}

TEST(ModesTable, SaysThatRunsOfDifferentMixesCannotBeCompared) {
  auto other = run_of("energy");
  other.mix = "large";
  const std::vector<RunRecord> runs = {run_of("latency"), other};
  EXPECT_THAT(modes_table(runs).footnotes, Contains(HasSubstr("NOT COMPARABLE: energy ran large")));
}

TEST(ModesTable, SaysThatRunsOfAChangedMachineCannotBeCompared) {
  auto other = run_of("energy");
  other.besides = {"--without gpu"};
  const std::vector<RunRecord> runs = {run_of("latency"), other};
  EXPECT_THAT(modes_table(runs).footnotes,
              Contains(HasSubstr("NOT COMPARABLE: energy ran small on host (--without gpu)")));
}

TEST(RanTheSame, IsOfWhatPlatformAndProfileHold) {
  RunRecord one = run_of("edf"), other = run_of("budget");
  one.profile = "p.db";
  other.profile = "./p.db";
  EXPECT_FALSE(ran_the_same(one, other)) << "of records of before nothing else is known";
  one.profile_hash = other.profile_hash = "1";
  EXPECT_TRUE(ran_the_same(one, other));
  other.profile = "p.db";
  other.profile_hash = "2";
  EXPECT_FALSE(ran_the_same(one, other)) << "two files of one name";
  other.profile_hash = "1";
  one.platform_hash = "1";
  EXPECT_TRUE(ran_the_same(one, other));
  other.platform_hash = "2";
  EXPECT_FALSE(ran_the_same(one, other));
}

TEST(ModesTable, ShowsADashForUnitsThatARunDoesNotHave) {
  auto other = run_of("energy");
  other.units[0].unit = "gpu";
  const std::vector<RunRecord> runs = {run_of("latency"), other};
  const auto row = row_of(modes_table(runs), "gpu: tasks");
  EXPECT_EQ(row[1], "-");
  EXPECT_EQ(row[2], "4");
}

TEST(RunDocument, AccountsForEveryTaskAndNamesTheDevice) {
  auto run = run_of("latency");
  run.units[0].role = "gpu";
  run.units[0].device_is_cpu = true;
  const auto text = render(run_document(run), Format::kText);
  EXPECT_THAT(
      text,
      HasSubstr("5 tasks submitted: 4 completed (0 offloaded to the cloud), 1 dropped, 0 expired"));
  EXPECT_THAT(text, HasSubstr("Some CPU (computes on the host's cores, not a GPU)"));
  EXPECT_THAT(text, HasSubstr("cpu: service times measured, energy modelled"));
}

TEST(RunDocument, WhatDoesNotApplyIsADash) {
  const auto text = render(run_document(run_of("latency")), Format::kText);
  EXPECT_THAT(text, HasSubstr("p99 - ms"));
  EXPECT_THAT(text, Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace pirt
