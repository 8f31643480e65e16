#include "characterize/database_format.h"

#include <fmt/format.h>

#include <array>
#include <cassert>
#include <map>

#include "schema_files.h"
#include "workloads/base/embedded.h"

namespace pirt {
namespace {

using sqlite::Connection;
using sqlite::Statement;

// The text of each query is part of the checksum: those of an old version stay as they are.
constexpr std::array<std::string_view, 3> kRunQueries1 = {
    "SELECT run_id, started, finished, platform, seed FROM run WHERE run_id = ?",
    "SELECT key, value FROM environment WHERE run_id = ? ORDER BY key",
    "SELECT unit, ordinal, backend, device, device_is_cpu, cores FROM unit "
    "WHERE run_id = ? ORDER BY unit"};
constexpr std::array<std::string_view, 4> kCellQueries1 = {
    "SELECT run_id, workload, unit, ops, bytes, verification FROM cell WHERE cell_id = ?",
    "SELECT phase, state, provenance, valid, reasons, notes, samples, median_ns, mad_ns, p95_ns, "
    "p99_ns, ci_low_ns, ci_high_ns FROM measurement WHERE cell_id = ? ORDER BY phase, state",
    "SELECT phase, state, position, ns FROM measurement JOIN sample USING (measurement_id) "
    "WHERE cell_id = ? ORDER BY phase, state, position",
    "SELECT energy_j, provenance, source, valid, reasons FROM energy WHERE cell_id = ?"};

constexpr std::array<std::string_view, 4> kRunQueries2 = {
    "SELECT run_id, started, finished, platform, seed, plan FROM run WHERE run_id = ?",
    "SELECT key, value, kind FROM environment WHERE run_id = ? ORDER BY key",
    "SELECT unit, ordinal, backend, device, device_is_cpu, cores FROM unit "
    "WHERE run_id = ? ORDER BY unit",
    "SELECT unit, kind, per_second, variant, provenance, valid, reasons FROM peak "
    "WHERE run_id = ? ORDER BY unit, kind"};
constexpr std::array<std::string_view, 4> kCellQueries2 = {
    "SELECT run_id, workload, unit, ops, bytes, verification FROM cell WHERE cell_id = ?",
    "SELECT phase, state, provenance, valid, reasons, notes, samples, processes, median_ns, "
    "mad_ns, p95_ns, p99_ns, ci_low_ns, ci_high_ns FROM measurement WHERE cell_id = ? "
    "ORDER BY phase, state",
    "SELECT phase, state, position, ns, process FROM measurement "
    "JOIN sample USING (measurement_id) WHERE cell_id = ? ORDER BY phase, state, position",
    "SELECT energy_j, provenance, source, valid, reasons, domain, idle_subtracted FROM energy "
    "WHERE cell_id = ?"};

std::string_view schema_file(std::string_view name) {
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
void check_schema(const Connection& connection, const DatabaseFormat& format) {
  Connection reference(":memory:", Connection::Mode::kCreate, Nanos(0));
  reference.run(std::string(format.schema));
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

const DatabaseFormat& database_format(std::int64_t version) {
  static const std::array<DatabaseFormat, kDatabaseVersion> kFormats = {
      {{1, schema_file("v1.sql"), kRunQueries1, kCellQueries1},
       {2, schema_file("schema.sql"), kRunQueries2, kCellQueries2}}};
  assert(version >= kOldestDatabaseVersion && version <= kDatabaseVersion);
  return kFormats.at(static_cast<std::size_t>(version - 1));
}

std::int64_t run_checksum(const Connection& connection, std::int64_t run_id,
                          const DatabaseFormat& format) {
  return checksum(connection, run_id, format.run_queries);
}

std::int64_t cell_checksum(const Connection& connection, std::int64_t cell_id,
                           const DatabaseFormat& format) {
  return checksum(connection, cell_id, format.cell_queries);
}

void check_structure(const Connection& connection, const DatabaseFormat& format) {
  Statement integrity(connection, "PRAGMA integrity_check(1)");
  if (!integrity.step() || integrity.text(0) != "ok") connection.fail_damaged(integrity.text(0));
  check_schema(connection, format);
  Statement references(connection, "PRAGMA foreign_key_check");
  if (references.step()) {
    connection.fail_damaged(fmt::format("a row of '{}' refers to nothing", references.text(0)));
  }
}

void verify_all(const Connection& connection, const DatabaseFormat& format) {
  check_structure(connection, format);
  Statement runs(connection, "SELECT run_id, checksum FROM run");
  while (runs.step()) {
    if (runs.integer(1) != run_checksum(connection, runs.integer(0), format)) {
      connection.fail_damaged(fmt::format("checksum of run {}", runs.integer(0)));
    }
  }
  Statement cells(connection, "SELECT cell_id, workload, unit, run_id, checksum FROM cell");
  while (cells.step()) {
    if (cells.integer(4) != cell_checksum(connection, cells.integer(0), format)) {
      connection.fail_damaged(fmt::format("checksum of {} on {} in run {}", cells.text(1),
                                          cells.text(2), cells.integer(3)));
    }
  }
}

}  // namespace pirt
