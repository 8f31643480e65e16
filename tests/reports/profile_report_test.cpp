// What the profile tables say: figures with their marks, invalid rows, remarks, preferable units.
#include "reports/profile/profile_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "reports/profile/preference.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

PhaseRow row(const std::string& workload, const std::string& unit, Phase phase, double ms) {
  PhaseRow row;
  row.run_id = 1;
  row.platform = "host";
  row.workload = workload;
  row.unit = unit;
  row.backend = unit;
  row.phase = phase;
  row.samples = 20;
  row.median = from_ms(ms);
  row.ci_low = from_ms(ms * 0.98);
  row.ci_high = from_ms(ms * 1.02);
  return row;
}

EnergyRow energy(const std::string& workload, const std::string& unit, double joules) {
  return {.run_id = 1,
          .workload = workload,
          .unit = unit,
          .energy_j = joules,
          .provenance = Provenance::kModelled,
          .source = "model: active_w 10 W x call",
          .reasons = {}};
}

Profile profile_of(std::vector<PhaseRow> rows, std::vector<EnergyRow> energies = {}) {
  Profile profile;
  profile.path = "p.db";
  profile.runs = {{.run_id = 1,
                   .started = "2026-01-01T00:00:00Z",
                   .finished = "2026-01-01T00:01:00Z",
                   .platform = "host",
                   .seed = 1,
                   .environment = {{"cpu_model", "Some CPU"}},
                   .units = {{"cpu", "cpu", "Some CPU", true, {0}},
                             {"opencl", "opencl", "pthread", true, {1}}}}};
  profile.phases = std::move(rows);
  profile.energies = std::move(energies);
  return profile;
}

TEST(ProfileTable, MarksModelledEnergyAndLeavesOutPhasesThatAreNotThere) {
  const auto table = profile_table(profile_of(
      {row("sobel", "cpu", Phase::kExecute, 1.5), row("sobel", "cpu", Phase::kCall, 1.5)},
      {energy("sobel", "cpu", 0.015)}));
  ASSERT_EQ(table.rows.size(), 1U);
  EXPECT_THAT(table.rows[0], ElementsAre("sobel", "cpu", "1.50", "2.0%", "-", "-", "1.50", "-", "-",
                                         "-", "~15.0", "-", "20", ""));
}

TEST(ProfileTable, NeverPrintsAnInvalidFigure) {
  auto call = row("sobel", "cpu", Phase::kCall, 123);
  call.reasons = {"wrong_output"};
  const auto table = profile_table(profile_of({call}));
  EXPECT_EQ(table.rows[0][2], "invalid");
  EXPECT_EQ(table.rows[0].back(), "INVALID: wrong_output");
  for (const auto& cell : table.rows[0]) EXPECT_EQ(cell.find("123"), std::string::npos);
}

TEST(ProfileTable, NamesThePhasesOfRemarksUnlessTheCallIsMeant) {
  auto upload = row("sobel", "opencl", Phase::kUpload, 1);
  upload.notes = {"precision_not_reached"};
  auto call = row("sobel", "opencl", Phase::kCall, 2);
  call.notes = {"bimodal"};
  const auto table =
      profile_table(profile_of({upload, call, row("fc8", "opencl", Phase::kCall, 1)}));
  EXPECT_EQ(table.rows[0].back(), "precision_not_reached (upload); bimodal");
  EXPECT_THAT(table.footnotes, Contains(HasSubstr("bimodal: the samples have two centres")));
}

TEST(ProfileTable, EndsWithWhatItComesTo) {
  auto broken = row("conv2", "cpu", Phase::kCall, 1);
  broken.reasons = {"wrong_output"};
  const auto table = profile_table(
      profile_of({row("sobel", "cpu", Phase::kCall, 1), row("sobel", "opencl", Phase::kCall, 2),
                  row("fc8", "cpu", Phase::kCall, 1), broken}));
  EXPECT_EQ(table.footnotes.back(),
            "In short: 4 rows of 3 workloads, 0 uncertain, 1 not valid; fastest at so many: none "
            "1, cpu 2.");
}

TEST(ProfileTable, SaysOnceWhatHoldsForAllRowsOfAUnit) {
  auto a = row("sobel", "cpu", Phase::kCall, 1);
  auto b = row("fc8", "cpu", Phase::kCall, 1);
  a.notes = {"no_kernel_cache", "bimodal"};
  b.notes = {"no_kernel_cache"};
  const auto table = profile_table(profile_of({a, b}));
  EXPECT_EQ(table.rows[0].back(), "bimodal");
  EXPECT_EQ(table.rows[1].back(), "");
  EXPECT_THAT(table.footnotes, Contains("All rows of cpu: no_kernel_cache"));
}

TEST(ProfileTable, ACommonNoteOfOtherPhasesHidesNoCall) {
  const auto imprecise = [](PhaseRow row) {
    row.notes = {"precision_not_reached"};
    return row;
  };
  const auto table = profile_table(profile_of(
      {imprecise(row("sobel", "opencl", Phase::kLaunch, 1)),
       row("sobel", "opencl", Phase::kCall, 1), imprecise(row("fc8", "opencl", Phase::kUpload, 1)),
       imprecise(row("fc8", "opencl", Phase::kLaunch, 1)),
       imprecise(row("fc8", "opencl", Phase::kCall, 1)),
       imprecise(row("blur", "opencl", Phase::kDownload, 1)),
       row("blur", "opencl", Phase::kCall, 1)}));
  std::map<std::string, std::string> remarks;
  for (const auto& line : table.rows) remarks[line[0]] = line.back();
  EXPECT_EQ(remarks["fc8"], "precision_not_reached");
  EXPECT_EQ(remarks["sobel"], "");
  EXPECT_EQ(remarks["blur"], "");
  EXPECT_EQ(std::ranges::count_if(table.footnotes,
                                  [](const std::string& line) {
                                    return line.starts_with(
                                               "All rows of opencl: precision_not_reached (") &&
                                           line.find("launch") != std::string::npos &&
                                           line.find("upload") == std::string::npos;
                                  }),
            1);
}

TEST(ProfileHeader, NeverTakesACpuForAGpu) {
  auto profile = profile_of({row("sobel", "cpu", Phase::kCall, 1)});
  EXPECT_THAT(profile_header(profile).lines, Contains(HasSubstr("pthread, core 1; computes on the "
                                                                "host's own cores, not a GPU")));
  profile.runs[0].units = {{"cpu", "published", "CPU Kryo, 4 threads", true, {}}};
  EXPECT_THAT(profile_header(profile).lines, Contains(testing::EndsWith("CPU Kryo, 4 threads")));
}

TEST(Preference, RanksByTheCallAndJoinsWhatCannotBeToldApart) {
  const auto list = preferences(
      profile_of({row("sobel", "cpu", Phase::kCall, 2), row("sobel", "opencl", Phase::kCall, 1),
                  row("fc8", "cpu", Phase::kCall, 1.00), row("fc8", "opencl", Phase::kCall, 1.01)},
                 {energy("sobel", "cpu", 0.5), energy("sobel", "opencl", 1.0)}));
  ASSERT_EQ(list.size(), 2U);
  EXPECT_EQ(list[0].by_time.preferable(), "opencl");
  EXPECT_DOUBLE_EQ(*list[0].by_time.advantage(), 2.0);
  EXPECT_EQ(list[0].by_energy.preferable(), "cpu");
  EXPECT_EQ(list[0].paper_time, "GPU");
  EXPECT_EQ(list[1].by_time.preferable(), "cpu = opencl");
  EXPECT_EQ(list[1].by_energy.preferable(), "-");
  EXPECT_FALSE(list[1].paper_time.has_value());
}

TEST(Preference, LeavesOutWhatIsInvalid) {
  auto fast = row("sobel", "opencl", Phase::kCall, 1);
  fast.reasons = {"wrong_output"};
  const auto list = preferences(profile_of({row("sobel", "cpu", Phase::kCall, 2), fast}));
  EXPECT_EQ(list[0].by_time.preferable(), "cpu");
  EXPECT_FALSE(list[0].by_time.advantage().has_value());
}

TEST(ProfileJson, LeavesOutWhatIsNotKnown) {
  auto empty = row("sobel", "cpu", Phase::kCall, 1);
  empty.median.reset();
  empty.ci_low.reset();
  empty.ci_high.reset();
  const auto profile = profile_of({empty});
  const auto json = profile_json(profile, preferences(profile));
  EXPECT_FALSE(json["profile_summary"][0].contains("median_ns"));
  EXPECT_FALSE(json["profile_summary"][0].contains("ops"));
}

}  // namespace
}  // namespace pirt
