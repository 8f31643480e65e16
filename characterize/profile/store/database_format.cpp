#include "characterize/profile/store/database_format.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <map>
#include <span>

#include "characterize/profile/judgement.h"
#include "schema_files.h"
#include "workloads/base/embedded.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using sqlite::Connection;
using sqlite::Statement;

constexpr std::array<std::string_view, 8> kRunQueries = {
    "SELECT run_id, started, finished, platform, seed, plan FROM run WHERE run_id = ?",
    "SELECT key, value, kind FROM environment WHERE run_id = ? ORDER BY key",
    "SELECT unit, ordinal, backend, device, device_is_cpu, cores FROM unit "
    "WHERE run_id = ? ORDER BY unit",
    "SELECT unit, kind, per_second, variant, provenance, valid, reasons, doubts FROM peak "
    "WHERE run_id = ? ORDER BY unit, kind",
    // Which cells and visits there are; what each holds is in its own checksum.
    "SELECT workload, unit, checksum FROM cell WHERE run_id = ? ORDER BY workload, unit",
    "SELECT workload, unit, position, checksum FROM visit WHERE run_id = ? "
    "ORDER BY workload, unit, position",
    "SELECT unit, phase, sleep_ns, valid, reasons, samples, median_ns, mad_ns, p95_ns, p99_ns, "
    "ci_low_ns, ci_high_ns, doubts FROM unit_time WHERE run_id = ? ORDER BY unit, phase, sleep_ns",
    "SELECT unit, phase, sleep_ns, position, ns FROM unit_time JOIN unit_time_sample "
    "USING (unit_time_id) WHERE run_id = ? ORDER BY unit, phase, sleep_ns, position"};
/// Those of version 6; as all old ones, as they stood then: what they hash is part of their text.
constexpr std::array<std::string_view, 8> kRunQueries6 = {
    kRunQueries[0],
    kRunQueries[1],
    kRunQueries[2],
    "SELECT unit, kind, per_second, variant, provenance, valid, reasons FROM peak "
    "WHERE run_id = ? ORDER BY unit, kind",
    kRunQueries[4],
    kRunQueries[5],
    "SELECT unit, phase, sleep_ns, valid, reasons, samples, median_ns, mad_ns, p95_ns, p99_ns, "
    "ci_low_ns, ci_high_ns FROM unit_time WHERE run_id = ? ORDER BY unit, phase, sleep_ns",
    kRunQueries[7]};
/// Those of versions 3 and 4, which have no times of units.
constexpr std::span kRunQueries4 = std::span(kRunQueries6).first(6);
/// Those of version 5, whose only ones are hand-overs.
constexpr std::array<std::string_view, 8> kRunQueries5 = {
    kRunQueries6[0],
    kRunQueries6[1],
    kRunQueries6[2],
    kRunQueries6[3],
    kRunQueries6[4],
    kRunQueries6[5],
    "SELECT unit, sleep_ns, valid, reasons, samples, median_ns, mad_ns, p95_ns, p99_ns, ci_low_ns, "
    "ci_high_ns FROM handover WHERE run_id = ? ORDER BY unit, sleep_ns",
    "SELECT unit, sleep_ns, position, ns FROM handover JOIN handover_sample USING (handover_id) "
    "WHERE run_id = ? ORDER BY unit, sleep_ns, position"};
constexpr std::array<std::string_view, 4> kCellQueries = {
    "SELECT run_id, workload, unit, ops, bytes, verification, host_memory_bytes, "
    "device_memory_bytes FROM cell WHERE cell_id = ?",
    "SELECT phase, state, provenance, valid, reasons, notes, samples, processes, median_ns, "
    "mad_ns, p95_ns, p99_ns, ci_low_ns, ci_high_ns, mixture, bound_ns, cpu_ns, taken, doubts FROM "
    "measurement WHERE cell_id = ? ORDER BY phase, state",
    "SELECT phase, state, position, ns, process, sample.cpu_ns FROM measurement "
    "JOIN sample USING (measurement_id) WHERE cell_id = ? ORDER BY phase, state, position",
    "SELECT energy_j, provenance, source, valid, reasons, domain, idle_subtracted, mixture, "
    "ci_low_j, ci_high_j, doubts FROM energy WHERE cell_id = ?"};
/// Those of versions 4 to 6.
constexpr std::array<std::string_view, 4> kCellQueries6 = {
    "SELECT run_id, workload, unit, ops, bytes, verification FROM cell WHERE cell_id = ?",
    "SELECT phase, state, provenance, valid, reasons, notes, samples, processes, median_ns, "
    "mad_ns, p95_ns, p99_ns, ci_low_ns, ci_high_ns, mixture, bound_ns FROM measurement WHERE "
    "cell_id = ? "
    "ORDER BY phase, state",
    "SELECT phase, state, position, ns, process FROM measurement "
    "JOIN sample USING (measurement_id) WHERE cell_id = ? ORDER BY phase, state, position",
    "SELECT energy_j, provenance, source, valid, reasons, domain, idle_subtracted, mixture FROM "
    "energy "
    "WHERE cell_id = ?"};
/// Those of version 3.
constexpr std::array<std::string_view, 4> kCellQueries3 = {
    kCellQueries6[0],
    "SELECT phase, state, provenance, valid, reasons, notes, samples, processes, median_ns, "
    "mad_ns, p95_ns, p99_ns, ci_low_ns, ci_high_ns FROM measurement WHERE cell_id = ? "
    "ORDER BY phase, state",
    kCellQueries6[2],
    "SELECT energy_j, provenance, source, valid, reasons, domain, idle_subtracted FROM energy "
    "WHERE cell_id = ?"};

/// A table, with what it has beside the columns of version 3, and beside those of version 6.
struct UpgradedTable {
  std::string_view name, after_3, after_6;
};
/// In the order in which they refer to each other. Those of units' times begin empty before 6.
constexpr std::array<UpgradedTable, 11> kUpgradedTables = {
    {{"run", "", ""},
     {"environment", "", ""},
     {"unit", "", ""},
     {"visit", "", ""},
     {"peak", "", ", ''"},
     {"cell", "", ", NULL, NULL"},
     {"measurement", ", 0, NULL", ", NULL, NULL, ''"},
     {"sample", "", ", NULL"},
     {"energy", ", 0", ", NULL, NULL, ''"},
     {"unit_time", "", ", ''"},
     {"unit_time_sample", "", ""}}};
constexpr std::span kTablesBefore6 = std::span(kUpgradedTables).first(9);
/// What version 5 had of units' times.
constexpr std::string_view kUpgradeHandovers = R"(
INSERT INTO main.unit_time
SELECT handover_id, run_id, unit, 'handover', sleep_ns, valid, reasons, samples, median_ns, mad_ns, p95_ns, p99_ns, ci_low_ns, ci_high_ns, ''
FROM main.handover;
INSERT INTO main.unit_time_sample SELECT * FROM main.handover_sample;
DROP TABLE main.handover_sample;
DROP TABLE main.handover;
)";

std::string_view schema_of(std::int64_t version) {
  const std::string name =
      version == kDatabaseVersion ? "schema.sql" : fmt::format("schema-{}.sql", version);
  return find_embedded(schema_files::files(), name).value();
}

std::map<std::string, std::string> schema_objects(const Connection& connection) {
  std::map<std::string, std::string> objects;
  Statement query(connection, "SELECT name, sql FROM sqlite_schema WHERE sql IS NOT NULL");
  while (query.step()) objects[query.text(0)] = query.text(1);
  return objects;
}

/// What the file defines must be what the schema says, word for word: a changed view or constraint
/// would show other figures. Objects of others beside it are left alone.
void check_schema(const Connection& connection) {
  Connection reference("schema.sql", Connection::Mode::kMemory, Nanos(0));
  reference.run(std::string(schema_of(version_of(connection))));
  const auto expected = schema_objects(reference);
  const auto actual = schema_objects(connection);
  for (const auto& [name, sql] : expected) {
    const auto it = actual.find(name);
    if (it == actual.end()) connection.fail_damaged(fmt::format("'{}' is missing", name));
    if (it->second != sql) {
      connection.fail_damaged(fmt::format("the definition of '{}' was changed", name));
    }
  }
}

std::int64_t checksum(const Connection& connection, std::int64_t id,
                      std::span<const std::string_view> queries) {
  Hash64 hash;
  for (const auto sql : queries) {
    Statement query(connection, sql);
    query.bind(id);
    while (query.step()) query.hash_row(hash);
    hash.add(sql);
  }
  return static_cast<std::int64_t>(hash.value());
}

}  // namespace

std::string_view database_schema() { return schema_of(kDatabaseVersion); }

std::int64_t version_of(const Connection& connection) {
  Statement query(connection, "PRAGMA user_version");
  query.step();
  return query.integer(0);
}

std::int64_t run_checksum(const Connection& connection, std::int64_t run_id) {
  switch (version_of(connection)) {
    case 3:
    case 4:
      return checksum(connection, run_id, kRunQueries4);
    case 5:
      return checksum(connection, run_id, kRunQueries5);
    case 6:
      return checksum(connection, run_id, kRunQueries6);
    default:
      return checksum(connection, run_id, kRunQueries);
  }
}

std::int64_t cell_checksum(const Connection& connection, std::int64_t cell_id) {
  const std::int64_t version = version_of(connection);
  return checksum(connection, cell_id,
                  version == kOldestVersion    ? std::span(kCellQueries3)
                  : version < kDatabaseVersion ? std::span(kCellQueries6)
                                               : std::span(kCellQueries));
}

void verify_all(const Connection& connection) {
  Statement integrity(connection, "PRAGMA integrity_check(1)");
  if (!integrity.step() || integrity.text(0) != "ok") connection.fail_damaged(integrity.text(0));
  check_schema(connection);
  Statement references(connection, "PRAGMA foreign_key_check");
  if (references.step()) {
    connection.fail_damaged(fmt::format("a row of '{}' refers to nothing", references.text(0)));
  }
  // Cells first: a run's checksum covers theirs, and the message shall name the cell.
  Statement cells(connection, "SELECT cell_id, workload, unit, run_id, checksum FROM cell");
  while (cells.step()) {
    if (cells.integer(4) != cell_checksum(connection, cells.integer(0))) {
      connection.fail_damaged(fmt::format("checksum of {} on {} in run {}", cells.text(1),
                                          cells.text(2), cells.integer(3)));
    }
  }
  Statement runs(connection, "SELECT run_id, checksum FROM run");
  while (runs.step()) {
    if (runs.integer(1) != run_checksum(connection, runs.integer(0))) {
      connection.fail_damaged(fmt::format("checksum of run {}", runs.integer(0)));
    }
  }
}

namespace {

/// Ids first: a statement that steps through a table must not change it.
void renew_checksums(const Connection& connection, const std::string& table,
                     std::int64_t (*of)(const Connection&, std::int64_t)) {
  std::vector<std::int64_t> ids;
  Statement query(connection, fmt::format("SELECT {0}_id FROM {0}", table));
  while (query.step()) ids.push_back(query.integer(0));
  Statement update(connection, fmt::format("UPDATE {0} SET checksum = ? WHERE {0}_id = ?", table));
  for (const std::int64_t id : ids) update.bind(of(connection, id)).bind(id).run();
}

/// Doubts stand among the reasons.
void separate_doubts(const Connection& connection) {
  struct Judged {
    const char *table, *figure;
  };
  for (const auto& [table, figure] : {Judged{"measurement", "median_ns"},
                                      {"energy", "energy_j"},
                                      {"peak", "per_second"},
                                      {"unit_time", "median_ns"}}) {
    std::map<std::pair<std::string, bool>, Judgement> found;
    Statement query(connection,
                    fmt::format("SELECT DISTINCT reasons, {} IS NOT NULL FROM {} WHERE valid = 0",
                                figure, table));
    while (query.step()) {
      const bool has_figure = query.integer(1) != 0;
      found[{query.text(0), has_figure}] = judgement_of(split_words(query.text(0)), has_figure);
    }
    Statement update(
        connection,
        fmt::format("UPDATE {0} SET reasons = ?, doubts = ? WHERE reasons = ? AND doubts = '' AND "
                    "valid = 0 AND ({1} IS NOT NULL) = ?",
                    table, figure));
    for (const auto& [old, judged] : found) {
      update.bind(join_words(judged.reasons)).bind(join_words(judged.doubts));
      update.bind(old.first).bind(std::int64_t{old.second}).run();
    }
  }
}

/// However an upgrade ends, what is written afterwards is checked again.
class WithoutForeignKeys {
 public:
  explicit WithoutForeignKeys(Connection& connection) : connection_(connection) {
    connection_.run("PRAGMA foreign_keys = OFF");  // of no effect in a transaction
  }
  ~WithoutForeignKeys() {
    sqlite3_exec(connection_.handle(), "PRAGMA foreign_keys = ON", nullptr, nullptr, nullptr);
  }
  WithoutForeignKeys(const WithoutForeignKeys&) = delete;
  WithoutForeignKeys& operator=(const WithoutForeignKeys&) = delete;

 private:
  Connection& connection_;
};

}  // namespace

void upgrade(Connection& connection) {
  const WithoutForeignKeys off(connection);
  {
    sqlite::Transaction transaction(connection);
    const std::int64_t version = version_of(connection);
    if (version == kDatabaseVersion) return;
    std::string sql;
    const auto tables = version == 6 ? std::span(kUpgradedTables) : kTablesBefore6;
    for (const auto& [name, after_3, after_6] : tables) {
      sql += fmt::format("CREATE TEMP TABLE old_{0} AS SELECT * FROM main.{0};", name);
    }
    for (const auto* view : {"profile_summary", "energy_summary", "condition_summary",
                             "handover_summary", "unit_time_summary"}) {
      sql += fmt::format("DROP VIEW IF EXISTS main.{};", view);
    }
    for (const auto& [name, after_3, after_6] : tables) {
      sql += fmt::format("DROP TABLE main.{};", name);
    }
    sql += database_schema();
    for (const auto& [name, after_3, after_6] : tables) {
      sql += fmt::format("INSERT INTO main.{0} SELECT *{1}{2} FROM temp.old_{0};", name,
                         version == kOldestVersion ? after_3 : "", after_6);
      sql += fmt::format("DROP TABLE temp.old_{};", name);
    }
    if (version == 5) sql += kUpgradeHandovers;
    connection.run(sql);
    separate_doubts(connection);
    renew_checksums(connection, "cell", cell_checksum);
    renew_checksums(connection, "run", run_checksum);
    transaction.commit();
  }
}

std::int64_t visit_checksum(std::int64_t run_id, const CellName& cell, const VisitRecord& visit) {
  Hash64 hash;
  hash.add(static_cast<std::uint64_t>(run_id)).add(cell.workload).add(cell.unit);
  hash.add(static_cast<std::uint64_t>(visit.position)).add(to_string(visit.setup));
  hash.add(visit.record);
  return static_cast<std::int64_t>(hash.value());
}

std::string join_words(const std::vector<std::string>& words) {
  std::vector<std::string> clean = words;
  for (std::string& word : clean) std::ranges::replace(word, ';', ',');
  return join(clean, "; ");
}

std::vector<std::string> split_words(const std::string& text) {
  if (text.empty()) return {};
  std::vector<std::string> words = split(text, ';');
  for (std::string& word : words) {
    if (word.starts_with(' ')) word.erase(0, 1);
  }
  return words;
}

}  // namespace pirt
