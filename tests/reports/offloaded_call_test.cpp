// One call part by part, of a measured DSP beside units that the platform file gives figures of.
#include "reports/paper/offloaded_call.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pirt {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kBoard = R"(
platform: board
units:
  gpu: {servers: 1, discipline: fifo, active_w: 1, idle_w: 0}
  cpu: {servers: 4, discipline: fifo, active_w: 1, idle_w: 0}
  dsp: {backend: dsp, servers: 1, discipline: fifo, slots: 1}
workloads:
  convolution:
    cpu: [{on: cpu, ms: 7, name: kernel}]
    gpu: [{on: cpu, ms: 4, name: setup}, {delay_ms: 0.5, name: dma}, {on: gpu, ms: 2, name: kernel}]
    provenance: fitted
    source: a test
)";

PhaseRow row(Phase phase, Origin provenance, double ms) {
  PhaseRow row;
  row.platform = "board";
  row.workload = "convolution";
  row.unit = "dsp";
  row.phase = phase;
  row.provenance = provenance;
  row.median = from_ms(ms);
  return row;
}

/// A call of 3 ms: copies 0.25 + 0.25, launch 0.5, execute 2, at least 1.
Profile dsp_profile() {
  Profile profile;
  profile.runs.emplace_back().platform = "board";
  profile.phases = {row(Phase::kUpload, Provenance::kPublished, 0.25),
                    row(Phase::kLaunch, Provenance::kPublished, 0.5),
                    row(Phase::kExecute, Provenance::kModelled, 2),
                    row(Phase::kDownload, Provenance::kPublished, 0.25),
                    row(Phase::kCall, {Provenance::kPublished, true}, 3)};
  profile.phases[2].bound = from_ms(1);
  return profile;
}

std::vector<OffloadedCall> calls_of(const Profile& profile) {
  return offloaded_calls(profile, parse_platform("board.yaml", kBoard, {}, 2), "convolution");
}

TEST(OffloadedCall, SplitsCallsOfMeasuredAndModelledUnits) {
  const auto table = offloaded_convolution_table(calls_of(dsp_profile()));
  ASSERT_EQ(table.rows.size(), 3U);
  EXPECT_THAT(table.rows[0], ElementsAre("gpu", "-", "^4.00", "-", "^0.500", "^2.00", "^6.50",
                                         "69%", "fastest execution, largest set-up"));
  EXPECT_THAT(table.rows[1], ElementsAre("cpu", "-", "-", "-", "-", "^7.00", "^7.00", "0%", "-"));
  EXPECT_THAT(table.rows[2], ElementsAre("dsp", "-", "-", "+0.500", "+0.500", "~2.00", "+*3.00",
                                         "33%", "smallest set-up, preferable in all"));
}

TEST(OffloadedCall, SaysWhetherThePaperHoldsHere) {
  auto profile = dsp_profile();
  profile.phases[2].median = from_ms(2.1);
  EXPECT_THAT(offloaded_convolution_table(calls_of(profile)).footnotes[0],
              HasSubstr("Here gpu executes fastest and dsp is preferable in all; in the paper the "
                        "GPU and the DSP: the same."));
  profile.phases[2].median = from_ms(1.9);
  EXPECT_THAT(offloaded_convolution_table(calls_of(profile)).footnotes[0],
              HasSubstr("Here dsp executes fastest and dsp is preferable in all"));
}

TEST(OffloadedCall, LeavesOutWhatIsNotValid) {
  auto profile = dsp_profile();
  profile.phases[2].reasons = {"wrong_output"};
  const auto calls = calls_of(profile);
  ASSERT_EQ(calls.size(), 3U);
  EXPECT_FALSE(calls[2].execute || calls[2].bound);
  EXPECT_FALSE(paper_dsp(calls));
  profile.phases[4].reasons = {"wrong_output"};
  EXPECT_EQ(calls_of(profile).size(), 2U);
}

// Table I's 30.1 million operations at 4 GOPS/s; Table V's 18.61 ms.
TEST(PaperDsp, StandsBetweenVectorsScalarCodeAndThePeak) {
  const auto dsp = paper_dsp(calls_of(dsp_profile()));
  ASSERT_TRUE(dsp);
  const auto table = paper_dsp_table(*dsp);
  ASSERT_EQ(table.rows.size(), 5U);
  EXPECT_THAT(table.rows[0], ElementsAre("HVX, no stalls", "#1.00", "0.5x"));
  EXPECT_THAT(table.rows[1], ElementsAre("HVX, with the memory model", "~2.00", "1x"));
  EXPECT_THAT(table.rows[2], ElementsAre(HasSubstr("Table II"), "+7.53", "3.76x"));
  EXPECT_THAT(table.rows[3], ElementsAre(HasSubstr("Table V"), "^18.6", "9.3x"));
  EXPECT_EQ(table.rows[4][1], "#21.1");
}

TEST(PaperDsp, ConcludesFromTheFigures) {
  auto dsp = paper_dsp(calls_of(dsp_profile())).value();
  EXPECT_THAT(dsp.conclusion(), HasSubstr("whose vectors were not used"));
  dsp.fitted.time = from_ms(3);
  EXPECT_THAT(dsp.conclusion(),
              HasSubstr("1.50 times what vector code takes: that of vector code"));
  dsp.fitted.time = from_ms(8);
  EXPECT_THAT(dsp.conclusion(), HasSubstr("neither's"));
}

TEST(PaperDsp, IsOfTheEmulatedDspOnly) {
  auto calls = calls_of(dsp_profile());
  calls[2].backend = "fake";
  EXPECT_FALSE(paper_dsp(calls));
}

}  // namespace
}  // namespace pirt
