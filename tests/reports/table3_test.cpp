// The paper's Table III, rebuilt of several profiles.
#include "reports/paper/table3.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/reports/profiles.h"

namespace pirt {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

struct Unit {
  std::string name, backend;
  bool device_is_cpu = false;
};

PhaseRow row_of(const Unit& unit, const std::string& workload, Phase phase, double ms) {
  PhaseRow row = test::small_row(workload, phase, State::kSteady, ms);
  row.unit = unit.name;
  row.backend = unit.backend;
  row.ops = 1'000'000;
  row.bytes = 1'000;
  return row;
}

/// A profile without rows.
Profile profile_of(const std::string& platform, const std::vector<Unit>& units) {
  Profile profile;
  profile.path = platform + ".db";
  RunInfo& run = profile.runs.emplace_back();
  run.run_id = 1;
  run.platform = platform;
  for (const Unit& unit : units) {
    run.units.push_back({unit.name, unit.backend, "Some " + unit.backend, unit.device_is_cpu, {}});
  }
  return profile;
}

void add(Profile& profile, const Unit& unit, const std::string& workload, double execute_ms,
         double call_ms) {
  profile.phases.push_back(row_of(unit, workload, Phase::kExecute, execute_ms));
  profile.phases.push_back(row_of(unit, workload, Phase::kCall, call_ms));
}

void add_peaks(Profile& profile, const std::string& unit, double ops, double bytes) {
  for (const auto& [kind, rate] :
       {std::pair(PeakKind::kF32, ops), std::pair(PeakKind::kBandwidthMemory, bytes)}) {
    PeakRow& peak = profile.peaks.emplace_back();
    peak.unit = unit;
    peak.kind = kind;
    peak.per_second = rate;
  }
}

const Unit kCpu{"cpu", "cpu", true}, kOpencl{"opencl", "opencl", true}, kDsp{"dsp", "dsp"},
    kFpga{"fpga", "fpga"};

/// Twice the Kryo's peak, so that what computes takes twice as long there.
Profile host() {
  Profile profile = profile_of("host", {kCpu, kOpencl});
  add(profile, kCpu, "sobel", 1.0, 1.1);
  add(profile, kOpencl, "sobel", 2.0, 3.0);
  add_peaks(profile, "cpu", 2 * 4 * 2200e6 * 8, 1e15);
  add_peaks(profile, "opencl", 256 * 624e6 * 2, 1e15);
  return profile;
}

Profile counted(const std::string& platform, const Unit& unit, double execute_ms) {
  Profile profile = profile_of(platform, {unit});
  add(profile, unit, "sobel", execute_ms, 2 * execute_ms);
  for (PhaseRow& row : profile.phases) row.provenance = Provenance::kCounted;
  profile.phases.front().bound = from_ms(execute_ms / 4);
  return profile;
}

double value_of(const Ranking& ranking, const std::string& unit) {
  const auto found = std::ranges::find(ranking.units, unit, &RankedUnit::unit);
  return found == ranking.units.end() ? -1 : found->value;
}

TEST(Table3, RanksTheUnitsOfAllProfilesAsTheyAreAndAtTheBoardsSize) {
  const Profile here = host(), dsp = counted("counted", kDsp, 5.0), fpga = counted("de1", kFpga, 1);
  const std::vector<const Profile*> profiles = {&here, &dsp, &fpga};
  const auto table = table3(profiles);
  ASSERT_EQ(table.rows.size(), 1U);
  const Table3Row& row = table.rows[0];
  EXPECT_EQ(row.workload, "sobel");
  EXPECT_EQ(row.here.preferable(), "host/cpu");
  EXPECT_DOUBLE_EQ(value_of(row.here, "counted/dsp"), 10.0);
  EXPECT_DOUBLE_EQ(value_of(row.boards, "CPU"), 2.0);   // twice the peak here
  EXPECT_DOUBLE_EQ(value_of(row.boards, "mGPU"), 2.0);  // the same peak
  EXPECT_NEAR(value_of(row.boards, "GPU"), 2.0 * 624 / 998, 1e-12);
  EXPECT_DOUBLE_EQ(value_of(row.boards, "DSP"), 5.0);
  EXPECT_EQ(row.boards.preferable(), "FPGA");
  EXPECT_EQ(row.paper_time, "GPU");
  const auto mark = [&](const char* unit) {
    return std::ranges::find(row.boards.units, unit, &RankedUnit::unit)->provenance;
  };
  EXPECT_EQ(mark("CPU"), Origin(Provenance::kModelled));
  EXPECT_EQ(mark("DSP"), Origin(Provenance::kCounted));
  EXPECT_THAT(row.difference, AllOf(HasSubstr("GPU takes 1.25x what FPGA takes"),
                                    HasSubstr("scaled from host/opencl on a CPU's cores"),
                                    HasSubstr("counted; 25% of it is the core alone")));
}

TEST(Table3, EnergyWithoutAFigureIsNamedAndInNoCount) {
  Profile here = host();
  EnergyRow energy;
  energy.workload = "sobel";
  energy.unit = "opencl";
  energy.energy_j = 0.002;
  here.energies = {energy};
  const Profile dsp = counted("counted", kDsp, 5.0);
  const std::vector<const Profile*> profiles = {&here, &dsp};
  const Table3 table = table3(profiles);
  EXPECT_EQ(table.rows[0].energy.preferable(), "host/opencl");
  EXPECT_THAT(table.rows[0].no_energy, ElementsAre("host/cpu", "counted/dsp"));
}

TEST(Table3, WhatIsBoundByMemoryScalesWithMemory) {
  Profile here = profile_of("host", {kCpu});
  add(here, kCpu, "sobel", 1.0, 1.0);
  add_peaks(here, "cpu", 1e15, 2 * 1866e6 * 2 * 8);
  for (PhaseRow& row : here.phases) row.ops.reset();
  const std::vector<const Profile*> profiles = {&here};
  EXPECT_DOUBLE_EQ(value_of(table3(profiles).rows[0].boards, "CPU"), 2.0);
}

TEST(Table3, SaysNothingThatItDoesNotKnow) {
  Profile here = host();
  here.peaks.clear();
  const std::vector<const Profile*> profiles = {&here};
  const Table3 without_peaks = table3(profiles);
  EXPECT_THAT(without_peaks.rows[0].boards.units, IsEmpty());
  EXPECT_EQ(without_peaks.rows[0].difference, "");
  EXPECT_EQ(table3_tables(without_peaks)[0].rows[0][2], "-");
  for (PhaseRow& row : here.phases) row.reasons = {"wrong_output"};
  EXPECT_THAT(table3(profiles).rows, IsEmpty());
  EXPECT_THAT(table3_tables(table3(profiles)), IsEmpty());
}

TEST(Table3, NamesTheUnitThatIsMissing) {
  Profile here = host();
  for (PhaseRow& row : here.phases) row.workload = "optical_flow";
  const std::vector<const Profile*> profiles = {&here};
  EXPECT_EQ(table3(profiles).rows[0].difference, "no profile here has a valid figure of its FPGA");
}

TEST(Table3, ShowsFormulaSourcesAndMarks) {
  const Profile here = host(), dsp = counted("counted", kDsp, 5.0);
  const std::vector<const Profile*> profiles = {&here, &dsp};
  const auto tables = table3_tables(table3(profiles));
  ASSERT_EQ(tables.size(), 2U);
  for (const Table& table : tables) {
    for (const auto& row : table.rows) EXPECT_EQ(row.size(), table.columns.size());
  }
  const auto& notes = tables[1].footnotes;
  EXPECT_THAT(notes[0], HasSubstr("execute x max(operations / P, bytes / B)"));
  EXPECT_EQ(std::ranges::count_if(notes,
                                  [](const std::string& note) {
                                    return note.find("which is a CPU and no GPU") !=
                                           std::string::npos;
                                  }),
            1);
  const Json json = table3_json(table3(profiles));
  EXPECT_EQ(json["workloads"][0]["boards"]["units"].size(), 4U);
}

}  // namespace
}  // namespace pirt
