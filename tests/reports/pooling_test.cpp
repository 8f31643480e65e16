// Several runs of one database as one, and which are not.
#include "reports/gate/pooling.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <tuple>

#include "characterize/profile/own_rows.h"
#include "characterize/profile/store/writer.h"
#include "tests/characterize/support.h"
#include "workloads/own/definition.h"

namespace pirt {
namespace {

/// Appends a run of my.pooled, from a file with that digest at @p source.
void add_run(const std::filesystem::path& file, const std::string& digest,
             const std::vector<std::string>& notes, const char* source = "/robot/w.yaml",
             double f32 = 200e9) {
  own::Definition definition;
  definition.name = "my.pooled";
  definition.source = source;
  definition.digest = digest;
  definition.outputs = {own::tensor_from("out", "u8[4]")};
  definition.backends = {"cpu"};
  RunHeader header = test::small_run();
  header.environment.merge(own_facts(own::to_workload(definition)));
  ProfileWriter writer(file);
  const auto run = writer.begin_run(header);
  CellRecord cell = test::small_cell("my.pooled", "cpu");
  for (PhaseRecord& phase : cell.phases) phase.notes = notes;
  writer.write_cell(run, cell);
  writer.write_peaks(
      run, std::vector{PeakRecord{"cpu", PeakKind::kF32, f32, "loop", Provenance::kMeasured, {}}});
  writer.finish_run(run, "2024-01-02T03:05:00Z");
}

TEST(Pooling, RunsOfAnEditedWorkloadFileAreTwoPrograms) {
  const test::TemporaryFolder folder;
  for (const auto& [name, older, runs] :
       {std::tuple("same.db", "1", 2), std::tuple("edited.db", "0", 1)}) {
    SCOPED_TRACE(name);
    add_run(folder / name, older, {}, "/builds/1/w.yaml");
    add_run(folder / name, "1", {});
    const ProfileReader reader(folder / name);
    Profile profile = reader.read();
    const Pooled pooled = pool_samples(reader, profile);
    EXPECT_EQ(pooled.runs, runs);
    EXPECT_EQ(pooled.left_out, 2 - runs);
    EXPECT_EQ(profile.find("my.pooled", "cpu", Phase::kCall)->samples, 20 * runs);
  }
}

TEST(Pooling, ARowNamesItsRunsAndTheProfileHasTheirPeaks) {
  const test::TemporaryFolder folder;
  for (const double f32 : {200e9, 210e9, 160e9}) {
    add_run(folder / "p.db", "1", {}, "/robot/w.yaml", f32);
  }
  const ProfileReader reader(folder / "p.db");
  Profile profile = reader.read();
  EXPECT_EQ(pool_samples(reader, profile).runs, 3);
  EXPECT_THAT(profile.find("my.pooled", "cpu", Phase::kCall)->pooled_runs,
              testing::ElementsAre(2, 1));
  EXPECT_EQ(profile.find_peak("cpu", PeakKind::kF32)->per_second, 160e9);
  EXPECT_THAT(profile.earlier_peaks,
              testing::ElementsAre(testing::Field(&PeakRow::per_second, testing::Optional(210e9)),
                                   testing::Field(&PeakRow::per_second, testing::Optional(200e9))));
}

// A tail beside other programs is nobody's for sure: tail.h asks for the note.
TEST(Pooling, WhatOneRunTookBesideOtherProgramsIsNoted) {
  const test::TemporaryFolder folder;
  add_run(folder / "p.db", "1", {"contended"});
  add_run(folder / "p.db", "1", {});
  const ProfileReader reader(folder / "p.db");
  Profile profile = reader.read();
  EXPECT_EQ(pool_samples(reader, profile).runs, 2);
  EXPECT_THAT(profile.find("my.pooled", "cpu", Phase::kCall)->notes,
              testing::ElementsAre("contended"));
}

}  // namespace
}  // namespace pirt
