
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "characterize/profile/profile.h"
#include "characterize/profile/records.h"
#include "characterize/profile/store/database_format.h"
#include "characterize/profile/store/reader.h"
#include "characterize/profile/store/writer.h"
#include "tests/characterize/profile/database_support.h"
#include "tests/characterize/support.h"

namespace pirt {
namespace {

using test::as_nobody;
using test::dump;
using test::error_of;
using test::in_child;
using test::run_sql;
using test::small_cell;
using test::small_run;
using test::TemporaryFolder;
using test::write_one_run;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> columns_of(const std::filesystem::path& path, const std::string& view) {
  sqlite3* handle = nullptr;
  EXPECT_EQ(sqlite3_open_v2(path.c_str(), &handle, SQLITE_OPEN_READONLY, nullptr), SQLITE_OK);
  sqlite3_stmt* statement = nullptr;
  sqlite3_prepare_v2(handle, ("SELECT * FROM " + view).c_str(), -1, &statement, nullptr);
  std::vector<std::string> names;
  for (int i = 0; i < sqlite3_column_count(statement); ++i) {
    names.emplace_back(sqlite3_column_name(statement, i));
  }
  sqlite3_finalize(statement);
  sqlite3_close(handle);
  return names;
}

TEST(Database, HasTheStableColumnsInTheirOrder) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  EXPECT_THAT(columns_of(folder / "p.db", "profile_summary"),
              ElementsAre("run_id", "platform", "workload", "unit", "backend", "phase", "state",
                          "provenance", "valid", "reasons", "notes", "samples", "median_ns",
                          "mad_ns", "p95_ns", "p99_ns", "ci_low_ns", "ci_high_ns", "ops", "bytes",
                          "processes", "mixture", "bound_ns", "cpu_ns", "taken",
                          "host_memory_bytes", "device_memory_bytes", "doubts"));
  EXPECT_THAT(columns_of(folder / "p.db", "energy_summary"),
              ElementsAre("run_id", "workload", "unit", "energy_j", "provenance", "source", "valid",
                          "reasons", "domain", "idle_subtracted", "mixture", "ci_low_j",
                          "ci_high_j", "doubts"));
  for (const char* view : {"condition_summary", "unit_time_summary", "handover_summary"}) {
    EXPECT_EQ(columns_of(folder / "p.db", view).back(), "doubts") << view;
  }
}

TEST(Database, IsOneFileWhenClosed) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  EXPECT_THAT(folder.entries(), ElementsAre("p.db"));
  static_cast<void>(load_profile(folder / "p.db"));
  EXPECT_THAT(folder.entries(), ElementsAre("p.db"));
}

TEST(Database, CanBeReadWhereNothingCanBeWritten) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  ::chmod((folder / "p.db").c_str(), 0444);
  ::chmod(folder.path().c_str(), 0555);
  as_nobody([&] { EXPECT_EQ(load_profile(folder / "p.db").phases.size(), 4U); });
  ::chmod(folder.path().c_str(), 0755);
}

TEST(Database, KeepsRawSamplesInOrder) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  const auto rows = load_samples(folder / "p.db", 1);
  ASSERT_EQ(rows.size(), 4U);
  EXPECT_EQ(rows[1].workload, "sobel");
  EXPECT_EQ(rows[1].phase, Phase::kCall);
  EXPECT_EQ(rows[1].samples, test::ramp(1000, 20));
  EXPECT_EQ(rows[2].state, State::kCold);
  EXPECT_TRUE(load_samples(folder / "p.db", 99).empty());
}

TEST(Database, JoinsAndSplitsReasons) {
  EXPECT_EQ(join_words({}), "");
  EXPECT_EQ(join_words({"contended", "bimodal"}), "contended; bimodal");
  EXPECT_EQ(split_words("contended; bimodal"), (std::vector<std::string>{"contended", "bimodal"}));
  EXPECT_TRUE(split_words("").empty());
  // A semicolon inside an entry must not become two entries.
  EXPECT_EQ(split_words(join_words({"error: a; b"})), (std::vector<std::string>{"error: a, b"}));
}

TEST(Database, AppendsARunToAnExistingFile) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  {
    ProfileWriter writer(folder / "p.db");
    EXPECT_EQ(writer.begin_run(small_run()), 2);
    writer.write_cell(2, small_cell("sobel", "cpu", 7000));
  }
  const Profile profile = load_profile(folder / "p.db");
  ASSERT_EQ(profile.runs.size(), 2U);
  // 20 samples from 7000 on: the mean of 7009 and 7010, rounded down.
  EXPECT_EQ(profile.find("sobel", "cpu", Phase::kCall)->median, Nanos(7009));
  EXPECT_EQ(profile.find("sobel", "gpu", Phase::kCall)->median, Nanos(3009));
}

// Who asks profile_summary for a phase gets calls in a row, whatever else was measured.
TEST(Database, OtherConditionsAreRowsOfTheirOwn) {
  const TemporaryFolder folder;
  auto cell = small_cell("sobel", "cpu");
  cell.phases.push_back(
      {Phase::kExecute, State::kSteady, Provenance::kMeasured, {}, {}, test::ramp(100, 20)});
  for (const Condition condition : {Condition::kColdCache, Condition::kBesideMemory}) {
    PhaseRecord record{Phase::kExecute,
                       State::kSteady,
                       Provenance::kMeasured,
                       {},
                       {},
                       test::ramp(condition == Condition::kColdCache ? 900 : 500, 20)};
    record.condition = condition;
    cell.conditions.push_back(std::move(record));
  }
  {
    ProfileWriter writer(folder / "p.db");
    const auto run = writer.begin_run(small_run());
    writer.write_cell(run, cell);
    writer.write_unit_times(
        run, std::vector<UnitTimeRecord>{
                 {"cpu", UnitPhase::kHandover, Nanos(0), {}, test::ramp(1000, 20)},
                 {"cpu", UnitPhase::kReread, std::chrono::milliseconds(1), {"few_samples"}, {}}});
    // A newer run has neither: rows of a live run.
    const auto live = writer.begin_run(small_run());
    writer.write_cell(live, small_cell("sobel", "cpu", 7000));
  }
  const ProfileReader reader(folder / "p.db");
  Profile profile = reader.read();
  reader.read_samples(profile);
  EXPECT_EQ(profile.find("sobel", "cpu", Phase::kCall)->median, Nanos(7009));
  EXPECT_EQ(profile.find("sobel", "cpu", Phase::kExecute), nullptr);
  ASSERT_EQ(profile.conditions.size(), 2U);
  const PhaseRow* cold = profile.find_condition("sobel", "cpu", Condition::kColdCache);
  ASSERT_NE(cold, nullptr);
  EXPECT_EQ(cold->median, Nanos(909));
  EXPECT_EQ(cold->values.size(), 20U);
  EXPECT_TRUE(cold->mean);
  EXPECT_EQ(profile.find_condition("sobel", "cpu", Condition::kBesideMemory)->values.front(),
            Nanos(500));
  EXPECT_EQ(profile.find_condition("sobel", "cpu", Condition::kBesideCompute), nullptr);
  ASSERT_EQ(profile.unit_times.size(), 2U);
  EXPECT_EQ(profile.unit_times[0].median, Nanos(1009));
  EXPECT_EQ(profile.unit_times[0].values.size(), 20U);
  EXPECT_FALSE(is_valid(profile.unit_times[1]));
  EXPECT_EQ(profile.unit_times[1].phase, UnitPhase::kReread);
  EXPECT_EQ(profile.runs.size(), 2U);
  const Profile first = reader.read({}, {1, 1});
  EXPECT_EQ(first.find("sobel", "cpu", Phase::kExecute)->median, Nanos(109));
}

TEST(Database, ARunThatWasCutOffHidesNoTimesOfUnits) {
  const TemporaryFolder folder;
  {
    ProfileWriter writer(folder / "p.db");
    const auto whole = writer.begin_run(small_run());
    writer.write_cell(whole, small_cell("sobel", "cpu"));
    std::vector<UnitTimeRecord> times;
    for (const UnitPhase phase : kAllUnitPhases) {
      times.push_back({"cpu", phase, Nanos(0), {}, test::ramp(1000, 20)});
    }
    writer.write_unit_times(whole, times);
    // Its time was over before the reading after a sweep.
    const auto part = writer.begin_run(small_run());
    writer.write_cell(part, small_cell("sobel", "cpu"));
    std::erase_if(times, [](const UnitTimeRecord& each) {
      return each.phase == UnitPhase::kLeave || each.phase == UnitPhase::kRereadCold;
    });
    writer.write_unit_times(part, times);
  }
  const Profile profile = load_profile(folder / "p.db");
  std::map<UnitPhase, std::int64_t> runs;
  for (const UnitTimeRow& row : profile.unit_times) runs[row.phase] = row.run_id;
  EXPECT_EQ(profile.unit_times.size(), 4U);
  EXPECT_EQ(runs, (std::map<UnitPhase, std::int64_t>{{UnitPhase::kHandover, 2},
                                                     {UnitPhase::kLeave, 1},
                                                     {UnitPhase::kReread, 1},
                                                     {UnitPhase::kRereadCold, 1}}));
}

TEST(Database, DamageOfAHandoverIsFound) {
  const TemporaryFolder folder;
  {
    ProfileWriter writer(folder / "p.db");
    const auto run = writer.begin_run(small_run());
    writer.write_cell(run, small_cell("sobel", "cpu"));
    writer.write_unit_times(run,
                            std::vector<UnitTimeRecord>{
                                {"cpu", UnitPhase::kHandover, Nanos(0), {}, test::ramp(1000, 20)}});
  }
  run_sql(folder / "p.db", "UPDATE unit_time_sample SET ns = 7 WHERE position = 3");
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return load_profile(folder / "p.db"); }),
              HasSubstr("checksum of run 1"));
}

TEST(Database, ExplainsWhatAFileIsInsteadOfADatabase) {
  const TemporaryFolder folder;
  test::write_bytes(folder / "empty.db", "");
  test::write_bytes(folder / "text.db",
                    "this is a text file and by no means a database, though long");
  test::write_bytes(folder / "short.db", "SQLite");
  test::write_bytes(folder / "cut.db", std::string("SQLite format 3\0 and the end", 28));
  run_sql(folder / "other.db", "PRAGMA application_id = 7; CREATE TABLE t (x)");
  write_one_run(folder / "newer.db");
  run_sql(folder / "newer.db", fmt::format("PRAGMA user_version = {}", kDatabaseVersion + 1));
  write_one_run(folder / "older.db");
  run_sql(folder / "older.db", "PRAGMA user_version = 2; DROP VIEW energy_summary");
  write_one_run(folder / "wal.db");
  run_sql(folder / "wal.db", "PRAGMA journal_mode = WAL");
  ASSERT_EQ(::mkfifo((folder / "pipe.db").c_str(), 0600), 0);

  const std::vector<std::pair<std::string, std::string>> cases = {
      {"missing.db", "there is no profile database"},
      {"empty.db", "is empty"},
      {"text.db", "not a profile database"},
      {"short.db", "not a profile database"},
      {"cut.db", "damaged (cut off after 28 bytes)"},
      {"other.db", "another application"},
      {"newer.db", "is of version 8, and this pirt reads version 7: use a newer pirt"},
      {"older.db", "is of version 2, and this pirt reads version 7: characterize again"},
      {"wal.db", "journal_mode=DELETE"},
      {"", "is not a file but a folder"},
      {"pipe.db", "is not a file but a device or pipe"}};
  for (const auto& [name, expected] : cases) {
    const auto path = folder / name;
    const std::string before = name == "pipe.db" || name.empty() ? "" : test::read_bytes(path);
    const auto entries = folder.entries();
    EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return load_profile(path); }),
                AllOf(HasSubstr(path.string()), HasSubstr(expected)));
    if (name != "missing.db") {  // a writer makes that one
      EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { ProfileWriter writer(path); }),
                  HasSubstr(expected));
    }
    EXPECT_EQ(folder.entries(), entries) << name;
    if (!before.empty()) {
      EXPECT_EQ(test::read_bytes(path), before) << name;
    }
  }
}

TEST(Database, ExplainsThatThereIsNothingInIt) {
  const TemporaryFolder folder;
  { const ProfileWriter writer(folder / "p.db"); }
  const auto problem = [&] {
    return error_of(ErrorCode::kBadInput, [&] { return load_profile(folder / "p.db"); });
  };
  EXPECT_THAT(problem(), HasSubstr("holds no measurements; add some with"));
  // A killed run, or one that is in its first minutes, has kept processes of cells.
  ProfileWriter writer(folder / "p.db");
  const auto run = writer.begin_run(small_run());
  EXPECT_THAT(problem(), HasSubstr("holds no measurements; add some with"));
  writer.write_visit(run, {"sobel", "cpu"}, {0, State::kCold, "record"});
  EXPECT_THAT(problem(), AllOf(HasSubstr("holds no measurements"), HasSubstr("did not end: 1;"),
                               HasSubstr("characterize --resume --db")));
}

TEST(Database, TakesEveryPathForAFile) {
  const TemporaryFolder folder;
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path());
  for (const auto* name : {":memory:", "file:y.db", "file::memory:?cache=shared"}) {
    write_one_run(name);
    EXPECT_EQ(load_profile(name).phases.size(), 4U) << name;
  }
  std::filesystem::current_path(before);
  EXPECT_THAT(folder.entries(), ElementsAre(":memory:", "file::memory:?cache=shared", "file:y.db"));
}

TEST(Database, CannotBeMadeWhereThereIsNoFolder) {
  const TemporaryFolder folder;
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { ProfileWriter writer(folder / "no/p.db"); }),
              HasSubstr("cannot make profile database"));
  EXPECT_TRUE(folder.entries().empty());
}

TEST(Database, SaysThatAPlaceMayNotBeRead) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  ::chmod(folder.path().c_str(), 0);
  as_nobody([&] {
    const auto denied = AllOf(HasSubstr((folder / "p.db").string()), HasSubstr("Permission denied"),
                              HasSubstr("give a path that you may read"));
    EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return load_profile(folder / "p.db"); }),
                denied);
    EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { ProfileWriter writer(folder / "p.db"); }),
                denied);
  });
  ::chmod(folder.path().c_str(), 0755);
}

TEST(Database, SaysThatAFileOrFolderIsReadOnly) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  ::chmod((folder / "p.db").c_str(), 0444);
  ::chmod(folder.path().c_str(), 0555);
  as_nobody([&] {
    EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { ProfileWriter writer(folder / "p.db"); }),
                HasSubstr("cannot be written (attempt to write a readonly database)"));
    EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { ProfileWriter writer(folder / "new.db"); }),
                HasSubstr("cannot make profile database"));
  });
  ::chmod(folder.path().c_str(), 0755);
  EXPECT_THAT(folder.entries(), ElementsAre("p.db"));
}

TEST(Database, RefusesRowsThatContradictThemselves) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open((folder / "p.db").c_str(), &handle), SQLITE_OK);
  const auto result = [&](const std::string& sql) {
    return sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, nullptr);
  };
  EXPECT_EQ(result("UPDATE measurement SET valid = 0"), SQLITE_CONSTRAINT);  // without a reason
  EXPECT_EQ(result("UPDATE measurement SET reasons = 'unstable'"), SQLITE_CONSTRAINT);
  EXPECT_EQ(result("UPDATE measurement SET median_ns = NULL"), SQLITE_CONSTRAINT);
  EXPECT_EQ(result("UPDATE measurement SET median_ns = -1"), SQLITE_CONSTRAINT);
  EXPECT_EQ(result("UPDATE measurement SET median_ns = 1.5"), SQLITE_CONSTRAINT);
  EXPECT_EQ(result("UPDATE measurement SET phase = 'exekute'"), SQLITE_CONSTRAINT);
  EXPECT_EQ(result("UPDATE measurement SET state = 'steady' WHERE phase = 'prepare'"),
            SQLITE_CONSTRAINT);
  EXPECT_EQ(result("UPDATE energy SET energy_j = NULL"), SQLITE_CONSTRAINT);
  EXPECT_EQ(result("UPDATE environment SET value = ''"), SQLITE_CONSTRAINT);
  EXPECT_EQ(result("PRAGMA foreign_keys = ON; DELETE FROM run"), SQLITE_CONSTRAINT);
  sqlite3_close(handle);
}

TEST(Database, NoticesChangedContentAndChangedViews) {
  const TemporaryFolder folder;
  const std::vector<std::pair<std::string, std::string>> changes = {
      {"UPDATE sample SET ns = ns + 1 WHERE position = 3", "checksum of sobel on cpu"},
      {"UPDATE measurement SET p99_ns = p99_ns + 1", "checksum of sobel on cpu"},
      {"UPDATE energy SET energy_j = 0.25", "checksum of sobel on cpu"},
      {"UPDATE environment SET value = 'other cpu'", "checksum of run 1"},
      {"DROP VIEW energy_summary", "'energy_summary' is missing"},
      {"DROP VIEW energy_summary; CREATE VIEW energy_summary AS SELECT 1", "definition of"},
      {"PRAGMA foreign_keys = OFF; DELETE FROM run", "refers to nothing"}};
  for (const auto& [sql, expected] : changes) {
    std::filesystem::remove(folder / "p.db");
    write_one_run(folder / "p.db");
    run_sql(folder / "p.db", sql);
    EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return load_profile(folder / "p.db"); }),
                AllOf(HasSubstr("damaged"), HasSubstr(expected)))
        << sql;
  }
}

TEST(Database, NoticesACellOrAProcessThatIsGone) {
  const TemporaryFolder folder;
  const std::string whole_cell =
      "DELETE FROM sample WHERE measurement_id IN "
      "(SELECT measurement_id FROM measurement WHERE cell_id = 2); "
      "DELETE FROM measurement WHERE cell_id = 2; DELETE FROM energy WHERE cell_id = 2; "
      "DELETE FROM cell WHERE cell_id = 2";
  for (const auto& sql : {whole_cell, std::string("DELETE FROM visit WHERE position = 1")}) {
    std::filesystem::remove(folder / "p.db");
    write_one_run(folder / "p.db");
    {
      ProfileWriter writer(folder / "p.db");
      writer.write_visit(1, {"fc8", "cpu"}, {0, State::kCold, "a"});
      writer.write_visit(1, {"fc8", "cpu"}, {1, State::kWarm, "b"});
    }
    static_cast<void>(load_profile(folder / "p.db"));
    run_sql(folder / "p.db", sql);
    EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return load_profile(folder / "p.db"); }),
                AllOf(HasSubstr("damaged"), HasSubstr("checksum of run 1")))
        << sql;
  }
}

TEST(Database, LeavesTablesOfOthersAlone) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  run_sql(folder / "p.db", "CREATE VIEW mine AS SELECT * FROM profile_summary");
  EXPECT_EQ(load_profile(folder / "p.db").phases.size(), 4U);
}

TEST(Database, WaitsForASecondWriterAndThenSaysSo) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  sqlite3* other = nullptr;
  ASSERT_EQ(sqlite3_open((folder / "p.db").c_str(), &other), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(other, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr), SQLITE_OK);
  ProfileWriter writer(folder / "p.db", std::chrono::milliseconds(200));
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [&] { writer.begin_run(small_run()); }),
              HasSubstr("in use by another program (waited 0.2 s)"));
  ASSERT_EQ(sqlite3_exec(other, "ROLLBACK", nullptr, nullptr, nullptr), SQLITE_OK);
  EXPECT_EQ(writer.begin_run(small_run()), 2);  // and works once the other is done
  sqlite3_close(other);
}

TEST(Database, GivesARunToOneWriterAtATime) {
  const TemporaryFolder folder;
  RunHeader header = small_run();
  header.plan = "{}";
  auto first = std::make_unique<ProfileWriter>(folder / "p.db");
  const auto run = first->begin_run(header);
  const auto seen = find_unfinished_run(folder / "p.db").value();
  ProfileWriter second(folder / "p.db");
  EXPECT_EQ(second.begin_run(small_run()), run + 1);  // another run goes all the same
  const auto resume = [&](const UnfinishedRun& unfinished) {
    second.resume_run(unfinished);
    return 0;
  };
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [&] { return resume(seen); }),
              AllOf(HasSubstr("run 1 of"), HasSubstr("is being measured by another program")));
  first->write_visit(run, {"sobel", "cpu"}, {0, State::kCold, "a"});
  first.reset();
  // What had been read before is not what there is to go on with.
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [&] { return resume(seen); }),
              HasSubstr("try again"));
  second.resume_run(find_unfinished_run(folder / "p.db").value());
  ProfileWriter third(folder / "p.db");
  EXPECT_THAT(error_of(ErrorCode::kEnvironment,
                       [&] {
                         third.resume_run(find_unfinished_run(folder / "p.db").value());
                         return 0;
                       }),
              HasSubstr("is being measured by another program"));
}

TEST(Database, LetsTwoWritersAppendInTurns) {
  const TemporaryFolder folder;
  ProfileWriter first(folder / "p.db");
  ProfileWriter second(folder / "p.db");
  const auto a = first.begin_run(small_run());
  const auto b = second.begin_run(small_run("other"));
  first.write_cell(a, small_cell("sobel", "cpu"));
  second.write_cell(b, small_cell("sobel", "cpu"));
  first.write_cell(a, small_cell("conv1", "cpu"));
  EXPECT_EQ(load_profile(folder / "p.db", "board").phases.size(), 4U);
  EXPECT_EQ(load_profile(folder / "p.db", "other").phases.size(), 2U);
}

TEST(Database, KeepsWhatWasStoredWhenTheDiskIsFull) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  const std::string right = dump(folder / "p.db");
  const int status = in_child([&] {
    ::signal(SIGXFSZ, SIG_IGN);
    const auto size = static_cast<rlim_t>(std::filesystem::file_size(folder / "p.db"));
    const rlimit limit{size + 4096, size + 4096};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    ProfileWriter writer(folder / "p.db");
    CellRecord large = small_cell("conv1", "cpu");
    large.phases[1].samples = test::ramp(1, 50'000);
    try {
      writer.write_cell(1, large);
    } catch (const Error& error) {
      const bool clear =
          std::string(error.what()).find("what was stored before is kept") != std::string::npos;
      ::_exit(error.code() == ErrorCode::kEnvironment && clear ? 17 : 18);
    }
  });
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 17);
  EXPECT_EQ(dump(folder / "p.db"), right);
}

TEST(Database, RollsBackWhatAKilledWriterLeft) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  const std::string right = dump(folder / "p.db");
  test::die_in_transaction(folder / "p.db");
  ASSERT_THAT(folder.entries(), ElementsAre("p.db", "p.db-journal"));
  EXPECT_EQ(dump(folder / "p.db"), right);
}

// As `rm p.db` after a kill does; SQLite takes what lies beside a file for its own.
TEST(Database, ANewFileTakesNoJournalOfARemovedOne) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  test::die_in_transaction(folder / "p.db");
  std::filesystem::remove(folder / "p.db");
  test::write_bytes(folder / "p.db-wal", "what is not a log either");
  ASSERT_THAT(folder.entries(), ElementsAre("p.db-journal", "p.db-wal"));
  write_one_run(folder / "p.db");
  EXPECT_THAT(folder.entries(), ElementsAre("p.db"));
  const TemporaryFolder elsewhere;
  write_one_run(elsewhere / "p.db");
  EXPECT_EQ(dump(folder / "p.db"), dump(elsewhere / "p.db"));
}

TEST(Database, MayBeNamedByALink) {
  const TemporaryFolder folder;
  const TemporaryFolder elsewhere;
  std::filesystem::create_symlink(elsewhere / "p.db", folder / "link.db");
  write_one_run(folder / "link.db");  // Nothing was there.
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.db"));
  const std::string right = dump(elsewhere / "p.db");
  test::die_in_transaction(folder / "link.db");
  ASSERT_THAT(elsewhere.entries(), ElementsAre("p.db", "p.db-journal"));
  EXPECT_EQ(load_profile(folder / "link.db").runs.size(), 1U);
  EXPECT_EQ(dump(folder / "link.db"), right);
  EXPECT_THAT(folder.entries(), ElementsAre("link.db"));
  EXPECT_THAT(elsewhere.entries(), ElementsAre("p.db"));
}

}  // namespace
}  // namespace pirt
