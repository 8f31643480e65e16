// What reports say of a run's environment, of the units' limits, and of what doctor found.
#include "reports/profile/environment_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "reports/profile/profile_report.h"
#include "reports/profile/roofline_report.h"
#include "reports/tools/doctor_report.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

/// fc8 on a unit of 1e9 op/s: 8.192 ms at least, in @p ms.
Profile profile_of(double ms) {
  Profile profile;
  RunInfo run;
  run.run_id = 3;
  run.platform = "board";
  run.seed = 5;
  run.environment = {{"cpu_model", "Some CPU"},
                     {"load_1m", "0.10"},
                     {"governor_unknown", "no cpufreq"},
                     {"temperature_c_unknown", "no zone"}};
  run.units = {{"cpu", "cpu", "Some CPU", true, {0}}};
  profile.runs = {run};
  PhaseRow row;
  row.run_id = 3;
  row.workload = "fc8";
  row.unit = "cpu";
  row.backend = "cpu";
  row.platform = "board";
  row.phase = Phase::kExecute;
  row.samples = 20;
  row.median = from_ms(ms);
  row.ops = 8'192'000;
  row.bytes = 16'408'384;
  profile.phases = {row};
  row.phase = Phase::kCall;
  profile.phases.push_back(row);
  PeakRow peak;
  peak.run_id = 3;
  peak.unit = "cpu";
  peak.kind = PeakKind::kF32;
  peak.per_second = 1e9;
  peak.variant = "a loop";
  profile.peaks = {peak};
  peak.kind = PeakKind::kInt8;
  peak.per_second.reset();
  peak.variant = "";
  peak.reasons = {"unavailable: no dot product"};
  profile.peaks.push_back(peak);
  return profile;
}

TEST(EnvironmentTable, HasIdentityFirstAndSaysWhatIsNotKnown) {
  const auto table = environment_table(profile_of(10));
  EXPECT_EQ(table.title, "Environment of run 3");
  EXPECT_THAT(table.rows[0], ElementsAre("cpu_model", "identity", "Some CPU"));
  EXPECT_THAT(table.rows, Contains(ElementsAre("seed", "identity", "5")));
  EXPECT_THAT(table.rows, Contains(ElementsAre("unit.cpu.cores", "identity", "0")));
  EXPECT_THAT(table.rows, Contains(ElementsAre("load_1m", "information", "0.10")));
  EXPECT_THAT(table.rows, Contains(ElementsAre("governor", "identity", "not known: no cpufreq")));
  EXPECT_THAT(table.rows,
              Contains(ElementsAre("temperature_c", "information", "not known: no zone")));
}

TEST(ProfileTable, SaysWhatFractionOfTheRooflineIsReached) {
  const auto profile = profile_of(16.384);
  const auto table = profile_table(profile);
  EXPECT_THAT(table.rows[0], Contains("50% f32"));
  EXPECT_THAT(table.footnotes, Contains(HasSubstr("min(peak, intensity x bandwidth)")));
  const auto json = profile_json(profile, {});
  EXPECT_DOUBLE_EQ(json["roofline"]["cells"][0]["fraction"].get<double>(), 0.5);
  EXPECT_EQ(json["roofline"]["cells"][0]["bound"], "f32");
  EXPECT_EQ(json["roofline"]["peaks"][0]["per_second"], 1e9);
  EXPECT_FALSE(json["roofline"]["peaks"][1].contains("per_second"));
  const auto& run = json["runs"][0];
  EXPECT_EQ(run["environment"]["governor_unknown"], "no cpufreq");
  EXPECT_EQ(run["identity"]["cpu_model"], "Some CPU");
  EXPECT_EQ(run["identity"]["unit.cpu.device"], "Some CPU");
  EXPECT_FALSE(run["identity"].contains("load_1m"));
}

TEST(ProfileTable, ShowsNoFractionOfAnExceededPeakAndSaysWhy) {
  const auto profile = profile_of(4);
  const auto table = profile_table(profile);
  EXPECT_THAT(table.rows[0], Not(Contains(HasSubstr("%"))));
  EXPECT_THAT(table.footnotes,
              Contains("No roofline for cpu: the unit's f32 peak is exceeded by fc8."));
  const auto roofs = rooflines(profile);
  EXPECT_EQ(peak_table(roofs).rows[0].back(), "INVALID: exceeded by fc8");
  EXPECT_EQ(peak_table(roofs).rows[1].back(), "unavailable: no dot product");
  const auto json = roofline_json(roofs);
  EXPECT_FALSE(json["cells"][0].contains("fraction"));
  EXPECT_EQ(json["cells"][0]["why_not"], "the unit's f32 peak is exceeded by fc8");
  EXPECT_EQ(json["peaks"][0]["valid"], false);
}

TEST(RooflineCell, ShowsSmallFractionsAndMarksModelledOnes) {
  Roofline cell;
  EXPECT_EQ(roofline_cell(&cell), "-");
  EXPECT_EQ(roofline_cell(nullptr), "-");
  cell.fraction = 0.0123;
  cell.bound = PeakKind::kBandwidthMemory;
  EXPECT_EQ(roofline_cell(&cell), "1.2% memory");
  cell.fraction = 0.5;
  cell.bound = PeakKind::kBandwidthL2;
  cell.provenance = Provenance::kModelled;
  EXPECT_EQ(roofline_cell(&cell), "~50% L2");
}

TEST(DoctorReport, ShowsTheWorstFirstWithWhatToDo) {
  const std::vector<Finding> findings = {
      {"build", Level::kGood, "Release", "", ""},
      {"swap", Level::kNote, "1 MB are in it", "pages may come back", "sudo swapoff -a"},
      {"turbo", Level::kSpoils, "on", "the clock depends on heat", "echo 1 | sudo tee f"}};
  const std::string text = render(doctor_document(findings), Format::kText);
  EXPECT_LT(text.find("turbo"), text.find("swap"));
  EXPECT_LT(text.find("swap"), text.find("build"));
  EXPECT_THAT(text, HasSubstr("turbo: the clock depends on heat.\n    echo 1 | sudo tee f"));
  EXPECT_THAT(text, HasSubstr("1 of 3 checks found what spoils measurements."));
  const auto json = doctor_json(findings);
  EXPECT_EQ(json["verdict"], "spoils");
  EXPECT_EQ(json["findings"][1]["remedy"], "sudo swapoff -a");
  EXPECT_FALSE(json["findings"][0].contains("remedy"));
}

}  // namespace
}  // namespace pirt
