#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "characterize/database.h"
#include "characterize/profile.h"
#include "tests/characterize/database_support.h"
#include "tests/characterize/support.h"

namespace pirt {
namespace {

using test::as_nobody;
using test::dump;
using test::error_of;
using test::make_version_1;
using test::read_bytes;
using test::run_sql;
using test::small_cell;
using test::small_run;
using test::TemporaryFolder;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(DatabaseMigration, ReadsVersion1WithoutTouchingIt) {
  const TemporaryFolder folder;
  make_version_1(folder / "p.db");
  const std::string before = read_bytes(folder / "p.db");
  const Profile profile = load_profile(folder / "p.db");
  EXPECT_EQ(read_bytes(folder / "p.db"), before);
  EXPECT_THAT(folder.entries(), ElementsAre("p.db"));

  // The figures that the old program printed for it.
  const PhaseRow* call = profile.find("sobel", "gpu", Phase::kCall);
  ASSERT_NE(call, nullptr);
  EXPECT_EQ(call->median, Nanos(19'250'005));
  EXPECT_EQ(call->ci_high, Nanos(19'968'129));
  EXPECT_EQ(call->samples, 43);
  EXPECT_EQ(call->processes, 1);  // one process sampled a cell
  EXPECT_THAT(call->notes, ElementsAre("precision_not_reached"));
  const PhaseRow* cold = profile.find("sobel", "gpu", Phase::kPrepare, State::kCold);
  ASSERT_NE(cold, nullptr);
  EXPECT_EQ(cold->processes, 2);  // each set-up was a process's
  EXPECT_DOUBLE_EQ(profile.find_energy("sobel", "cpu")->energy_j.value(), 0.114442652);
  EXPECT_EQ(profile.find_energy("sobel", "cpu")->domain, "unit");
  EXPECT_TRUE(profile.find_energy("sobel", "cpu")->idle_subtracted);
  EXPECT_FALSE(profile.find_energy("sobel", "gpu")->valid);
  EXPECT_TRUE(profile.peaks.empty());
  const RunInfo& run = profile.runs.at(0);
  EXPECT_THAT(run.identity, AllOf(Contains("cpu_model"), Contains("unit.gpu.version")));
  EXPECT_FALSE(run.identity.contains("load_1m"));
  EXPECT_TRUE(run.environment.contains("load_1m"));
  EXPECT_EQ(find_unfinished_run(folder / "p.db"), std::nullopt);
  for (const RowSamples& row : load_samples(folder / "p.db", 1)) {
    if (row.state == State::kSteady) {
      EXPECT_THAT(row.processes, Each(0));
    } else {
      EXPECT_THAT(row.processes, ElementsAre(0, 1));
    }
  }
}

TEST(DatabaseMigration, WritingMigratesTheFileAndKeepsACopyOfTheOldOne) {
  const TemporaryFolder folder;
  make_version_1(folder / "p.db");
  const std::string old = dump(folder / "p.db");
  run_sql(folder / "p.db", "CREATE VIEW mine AS SELECT count(*) FROM profile_summary");
  { const ProfileWriter writer(folder / "p.db"); }
  EXPECT_THAT(folder.entries(), ElementsAre("p.db", "p.db.v1.bak"));
  EXPECT_EQ(dump(folder / "p.db"), old);
  run_sql(folder / "p.db", "SELECT * FROM mine");
  EXPECT_EQ(dump(folder / "p.db.v1.bak"), old);
  // A second one migrates nothing.
  {
    ProfileWriter writer(folder / "p.db");
    writer.write_cell(writer.begin_run(small_run()), small_cell("fc8", "cpu"));
  }
  EXPECT_THAT(folder.entries(), ElementsAre("p.db", "p.db.v1.bak"));
  EXPECT_EQ(load_profile(folder / "p.db").runs.size(), 2U);
}

TEST(DatabaseMigration, NeverOverwritesACopy) {
  const TemporaryFolder folder;
  test::write_bytes(folder / "p.db.v1.bak", "something of the user's");
  make_version_1(folder / "p.db");
  make_version_1(folder / "q.db");
  { const ProfileWriter writer(folder / "p.db"); }
  EXPECT_EQ(read_bytes(folder / "p.db.v1.bak"), "something of the user's");
  EXPECT_THAT(folder.entries(), ElementsAre("p.db", "p.db.v1.bak", "p.db.v1.bak2", "q.db"));
  // Killed between copy and commit: the next one finds its own copy and makes no second one.
  std::filesystem::copy_file(folder / "q.db", folder / "p.db",
                             std::filesystem::copy_options::overwrite_existing);
  { const ProfileWriter writer(folder / "p.db"); }
  EXPECT_THAT(folder.entries(), ElementsAre("p.db", "p.db.v1.bak", "p.db.v1.bak2", "q.db"));
}

TEST(DatabaseMigration, LeavesAFileAloneWhoseCopyCannotBeMade) {
  const TemporaryFolder folder;
  make_version_1(folder / "p.db");
  const std::string before = read_bytes(folder / "p.db");
  ::chmod((folder / "p.db").c_str(), 0666);
  ::chmod(folder.path().c_str(), 0555);
  as_nobody([&] {
    EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { ProfileWriter writer(folder / "p.db"); }),
                AllOf(HasSubstr("cannot keep a copy"), HasSubstr("nothing was changed")));
    EXPECT_EQ(load_profile(folder / "p.db").phases.size(), 13U);  // reading goes all the same
  });
  ::chmod(folder.path().c_str(), 0755);
  EXPECT_EQ(read_bytes(folder / "p.db"), before);
  EXPECT_THAT(folder.entries(), ElementsAre("p.db"));
}

TEST(DatabaseMigration, GivesNoNewChecksumToDamage) {
  const TemporaryFolder folder;
  const std::vector<std::pair<std::string, std::string>> changes = {
      {"UPDATE sample SET ns = ns + 1 WHERE position = 3 AND measurement_id = 7",
       "checksum of sobel on gpu"},
      {"UPDATE energy SET energy_j = 0.25 WHERE cell_id = 2", "checksum of sobel on cpu"},
      {"UPDATE environment SET value = 'other' WHERE key = 'kernel'", "checksum of run 1"},
      {"DROP VIEW energy_summary", "'energy_summary' is missing"},
      {"PRAGMA foreign_keys = OFF; DELETE FROM cell", "refers to nothing"}};
  for (const auto& [sql, expected] : changes) {
    std::filesystem::remove(folder / "p.db");
    make_version_1(folder / "p.db");
    run_sql(folder / "p.db", sql);
    const std::string before = read_bytes(folder / "p.db");
    const auto damaged = AllOf(HasSubstr("damaged"), HasSubstr(expected));
    EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return load_profile(folder / "p.db"); }),
                damaged);
    EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { ProfileWriter writer(folder / "p.db"); }),
                damaged);
    EXPECT_EQ(read_bytes(folder / "p.db"), before);
    EXPECT_THAT(folder.entries(), ElementsAre("p.db"));
  }
}

TEST(DatabaseMigration, RefusesVersionsThatItDoesNotKnowByName) {
  const TemporaryFolder folder;
  test::write_one_run(folder / "p.db");
  for (const auto& [version, expected] :
       {std::pair("3", "use a newer pirt"), {"0", "which there never was"}}) {
    run_sql(folder / "p.db", std::string("PRAGMA user_version = ") + version);
    EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return load_profile(folder / "p.db"); }),
                AllOf(HasSubstr((folder / "p.db").string()),
                      HasSubstr(std::string("has format ") + version), HasSubstr(expected)));
  }
}

}  // namespace
}  // namespace pirt
