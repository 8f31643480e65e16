#include "characterize/profile/store/database_format.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <map>
#include <span>

#include "schema_files.h"
#include "workloads/base/embedded.h"
#include "workloads/base/text.h"

namespace pirt {
namespace {

using sqlite::Connection;
using sqlite::Statement;

constexpr std::array<std::string_view, 6> kRunQueries = {
    "SELECT run_id, started, finished, platform, seed, plan FROM run WHERE run_id = ?",
    "SELECT key, value, kind FROM environment WHERE run_id = ? ORDER BY key",
    "SELECT unit, ordinal, backend, device, device_is_cpu, cores FROM unit "
    "WHERE run_id = ? ORDER BY unit",
    "SELECT unit, kind, per_second, variant, provenance, valid, reasons FROM peak "
    "WHERE run_id = ? ORDER BY unit, kind",
    // Which cells and visits there are; what each holds is in its own checksum.
    "SELECT workload, unit, checksum FROM cell WHERE run_id = ? ORDER BY workload, unit",
    "SELECT workload, unit, position, checksum FROM visit WHERE run_id = ? "
    "ORDER BY workload, unit, position"};
constexpr std::array<std::string_view, 4> kCellQueries = {
    "SELECT run_id, workload, unit, ops, bytes, verification FROM cell WHERE cell_id = ?",
    "SELECT phase, state, provenance, valid, reasons, notes, samples, processes, median_ns, "
    "mad_ns, p95_ns, p99_ns, ci_low_ns, ci_high_ns FROM measurement WHERE cell_id = ? "
    "ORDER BY phase, state",
    "SELECT phase, state, position, ns, process FROM measurement "
    "JOIN sample USING (measurement_id) WHERE cell_id = ? ORDER BY phase, state, position",
    "SELECT energy_j, provenance, source, valid, reasons, domain, idle_subtracted FROM energy "
    "WHERE cell_id = ?"};

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
  reference.run(std::string(database_schema()));
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

std::string_view database_schema() {
  return find_embedded(schema_files::files(), "schema.sql").value();
}

std::int64_t run_checksum(const Connection& connection, std::int64_t run_id) {
  return checksum(connection, run_id, kRunQueries);
}

std::int64_t cell_checksum(const Connection& connection, std::int64_t cell_id) {
  return checksum(connection, cell_id, kCellQueries);
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
