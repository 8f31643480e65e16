// Profile databases of the versions before: read as they are, upgraded when they are written.
#include <gmock/gmock.h>

#include "schema_files.h"
#include "tests/characterize/profile/database_support.h"
#include "workloads/base/embedded.h"

namespace pirt::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

void renew_checksums(const std::filesystem::path& path) {
  const sqlite::Connection old(path, sqlite::Connection::Mode::kReadWrite, Nanos(0));
  for (const std::int64_t cell : {1, 2}) {
    run_sql(path, fmt::format("UPDATE cell SET checksum = {} WHERE cell_id = {}",
                              cell_checksum(old, cell), cell));
  }
  run_sql(path, fmt::format("UPDATE run SET checksum = {}", run_checksum(old, 1)));
}

/// What write_one_run wrote, as an older version had it; versions 5 and 6 with a hand-over of 1009
/// ns.
void make_old(const std::filesystem::path& path, int version) {
  write_one_run(path);
  // What version 7 brought, and version 4.
  std::string less = R"(
ALTER TABLE temp.c DROP COLUMN host_memory_bytes; ALTER TABLE temp.c DROP COLUMN device_memory_bytes;
ALTER TABLE temp.m DROP COLUMN cpu_ns; ALTER TABLE temp.m DROP COLUMN taken;
ALTER TABLE temp.m DROP COLUMN doubts; ALTER TABLE temp.s DROP COLUMN cpu_ns;
ALTER TABLE temp.j DROP COLUMN ci_low_j; ALTER TABLE temp.j DROP COLUMN ci_high_j;
ALTER TABLE temp.j DROP COLUMN doubts;)";
  if (version == 3) {
    less += R"(
ALTER TABLE temp.m DROP COLUMN mixture; ALTER TABLE temp.m DROP COLUMN bound_ns;
ALTER TABLE temp.j DROP COLUMN mixture;)";
  }
  const std::string schema = fmt::format("schema-{}.sql", version);
  run_sql(path, R"(
PRAGMA foreign_keys = OFF;
CREATE TEMP TABLE r AS SELECT * FROM run; CREATE TEMP TABLE e AS SELECT * FROM environment;
CREATE TEMP TABLE u AS SELECT * FROM unit; CREATE TEMP TABLE c AS SELECT * FROM cell;
CREATE TEMP TABLE m AS SELECT * FROM measurement; CREATE TEMP TABLE s AS SELECT * FROM sample;
CREATE TEMP TABLE j AS SELECT * FROM energy;
DROP VIEW profile_summary; DROP VIEW energy_summary; DROP VIEW condition_summary;
DROP VIEW handover_summary; DROP VIEW unit_time_summary; DROP TABLE unit_time_sample;
DROP TABLE unit_time; DROP TABLE sample;
DROP TABLE measurement; DROP TABLE energy; DROP TABLE cell; DROP TABLE peak; DROP TABLE visit;
DROP TABLE unit; DROP TABLE environment; DROP TABLE run;)" +
                    std::string(find_embedded(schema_files::files(), schema).value()) + less + R"(
INSERT INTO run SELECT * FROM r; INSERT INTO environment SELECT * FROM e;
INSERT INTO unit SELECT * FROM u; INSERT INTO cell SELECT * FROM c;
INSERT INTO measurement SELECT * FROM m; INSERT INTO sample SELECT * FROM s;
INSERT INTO energy SELECT * FROM j;)");
  if (version == 5) {
    run_sql(path, R"(
INSERT INTO handover VALUES (1, 1, 'cpu', 0, 1, '', 1, 1009, 0, 1009, 1009, NULL, NULL);
INSERT INTO handover_sample VALUES (1, 0, 1009);)");
  }
  if (version == 6) {
    run_sql(path, R"(
INSERT INTO unit_time VALUES (1, 1, 'cpu', 'handover', 0, 1, '', 1, 1009, 0, 1009, 1009, NULL, NULL);
INSERT INTO unit_time_sample VALUES (1, 0, 1009);)");
  }
  renew_checksums(path);
}

class DatabaseUpgrade : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(From, DatabaseUpgrade, ::testing::Values(3, 4, 5, 6));

TEST_P(DatabaseUpgrade, AnOldFileIsReadAsItIsAndNotWritten) {
  const TemporaryFolder folder;
  write_one_run(folder / "new.db");
  make_old(folder / "old.db", GetParam());
  const std::string before = read_bytes(folder / "old.db");
  EXPECT_EQ(dump(folder / "old.db"), dump(folder / "new.db"));
  EXPECT_EQ(read_bytes(folder / "old.db"), before);
  EXPECT_EQ(folder.entries().size(), 2U);
  EXPECT_TRUE(load_profile(folder / "old.db").conditions.empty());
  for (const PhaseRow& row : load_profile(folder / "old.db").phases) {
    EXPECT_FALSE(row.provenance.mixture);
    EXPECT_EQ(row.bound, std::nullopt);
  }
}

TEST_P(DatabaseUpgrade, AnOldFileThatIsWrittenBecomesANewOne) {
  const TemporaryFolder folder;
  make_old(folder / "old.db", GetParam());
  {
    ProfileWriter writer(folder / "old.db");
    EXPECT_EQ(writer.begin_run(small_run()), 2);
    writer.write_cell(2, small_cell("sobel", "cpu", 7000));
  }
  const Profile profile = load_profile(folder / "old.db");
  EXPECT_EQ(profile.find("sobel", "cpu", Phase::kCall)->median, Nanos(7009));
  EXPECT_EQ(profile.find("sobel", "gpu", Phase::kCall)->median, Nanos(3009));  // of the old run
  ASSERT_EQ(profile.unit_times.size(), GetParam() >= 5 ? 1U : 0U);
  for (const UnitTimeRow& row : profile.unit_times) {
    EXPECT_EQ(row.phase, UnitPhase::kHandover);
    EXPECT_EQ(row.median, Nanos(1009));
  }
  const sqlite::Connection file(folder / "old.db", sqlite::Connection::Mode::kReadOnly, Nanos(0));
  EXPECT_EQ(version_of(file), kDatabaseVersion);
}

TEST_P(DatabaseUpgrade, DoubtsAreToldFromReasons) {
  const TemporaryFolder folder;
  make_old(folder / "old.db", GetParam());
  run_sql(folder / "old.db", R"(
UPDATE measurement SET valid = 0, reasons = 'clock_bound; contended' WHERE phase = 'call' AND cell_id = 1;
UPDATE measurement SET valid = 0, reasons = 'contended' WHERE phase = 'call' AND cell_id = 2;
UPDATE measurement SET valid = 0, reasons = 'few_samples' WHERE samples = 0;
UPDATE energy SET valid = 0, reasons = 'unstable: idling before and after differ' WHERE cell_id = 1;)");
  renew_checksums(folder / "old.db");
  const Profile profile = load_profile(folder / "old.db");
  const PhaseRow& both = *profile.find("sobel", "cpu", Phase::kCall);
  EXPECT_THAT(both.reasons, ElementsAre("clock_bound"));
  EXPECT_THAT(both.doubts, ElementsAre("contended"));
  const PhaseRow& doubted = *profile.find("sobel", "gpu", Phase::kCall);
  EXPECT_TRUE(is_used(doubted));
  EXPECT_THAT(doubted.doubts, ElementsAre("contended"));
  for (const PhaseRow& row : profile.phases) {
    if (row.samples == 0) {
      EXPECT_THAT(row.reasons, ElementsAre("no_samples"));
    }
  }
  EXPECT_TRUE(is_doubted(*profile.find_energy("sobel", "cpu")));
}

TEST_P(DatabaseUpgrade, DamageInAnOldFileIsFound) {
  const TemporaryFolder folder;
  make_old(folder / "old.db", GetParam());
  run_sql(folder / "old.db", "UPDATE sample SET ns = ns + 1 WHERE position = 3");
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return load_profile(folder / "old.db"); }),
              HasSubstr("checksum of sobel"));
  EXPECT_THAT(error_of(ErrorCode::kBadInput,
                       [&] {
                         ProfileWriter writer(folder / "old.db");
                         return 0;
                       }),
              HasSubstr("checksum of sobel"));
}

}  // namespace
}  // namespace pirt::test
