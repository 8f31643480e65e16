#include "characterize/database_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <fstream>
#include <map>
#include <span>
#include <system_error>

#include "schema_files.h"
#include "workloads/base/embedded.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

using sqlite::Connection;
using sqlite::Statement;

std::string schema_text() {
  return std::string(find_embedded(schema_files::files(), "schema.sql").value());
}

constexpr std::size_t kHeaderBytes = 100;

/// Big-endian, as all of SQLite's header. @source https://www.sqlite.org/fileformat2.html,
/// section 1.3.
std::uint32_t header_word(std::span<const unsigned char> header, std::size_t offset) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | header[offset + i];
  return value;
}

/// Checks by its first bytes what a file is, before SQLite, which would take an empty file for an
/// empty database, sees it.
void identify(const std::filesystem::path& path) {
  const std::string name = path.string();
  std::error_code failed;
  const auto status = std::filesystem::status(path, failed);
  if (!std::filesystem::exists(status)) {
    throw_bad_input(fmt::format(
        "there is no profile database '{}'; make one with: pirt characterize --db {}", name, name));
  }
  if (!std::filesystem::is_regular_file(status)) {
    throw_bad_input(
        fmt::format("'{}' is not a file but a {}; give the path of a profile database", name,
                    std::filesystem::is_directory(status) ? "folder" : "device or pipe"));
  }
  std::array<unsigned char, kHeaderBytes> header{};
  errno = 0;
  std::ifstream in(path, std::ios::binary);
  if (!in) {
    throw_bad_input(fmt::format("cannot read profile database '{}': {}", name,
                                std::strerror(errno != 0 ? errno : EIO)));
  }
  in.read(reinterpret_cast<char*>(header.data()), header.size());
  const auto size = static_cast<std::size_t>(in.gcount());
  if (size == 0) {
    throw_bad_input(fmt::format(
        "'{}' is empty and no profile database; remove it, or give another path", name));
  }
  constexpr std::size_t kMagicBytes = 16;
  if (size < kMagicBytes || std::memcmp(header.data(), "SQLite format 3", kMagicBytes) != 0) {
    throw_bad_input(fmt::format(
        "'{}' is not a profile database (not SQLite); give a file that pirt characterize made",
        name));
  }
  if (size < kHeaderBytes) {
    throw_bad_input(
        fmt::format("profile database '{}' is damaged (cut off after {} bytes); restore a "
                    "copy, or characterize again into a new file",
                    name, size));
  }
  if (header_word(header, 68) != kDatabaseApplicationId) {
    throw_bad_input(fmt::format(
        "'{}' is a database of another application; give a file that pirt characterize made",
        name));
  }
  if (const auto version = header_word(header, 60); version != kDatabaseVersion) {
    throw_bad_input(fmt::format(
        "profile database '{}' has format {}, and this pirt knows {}; {}", name, version,
        kDatabaseVersion, version > kDatabaseVersion ? "use a newer pirt" : "characterize again"));
  }
  if (header[18] != 1 || header[19] != 1) {
    throw_bad_input(
        fmt::format("profile database '{}' is not in journal mode DELETE; convert it with: "
                    "sqlite3 {} 'PRAGMA journal_mode=DELETE'",
                    name, name));
  }
}

/// A writer that was killed in a transaction leaves a journal; only a connection that may write can
/// roll it back.
void recover(const std::filesystem::path& path, Nanos busy_wait) {
  auto journal = path;
  journal += "-journal";
  std::error_code failed;
  const auto size = std::filesystem::file_size(journal, failed);
  if (failed || size == 0) return;
  const Connection connection(path, Connection::Mode::kReadWrite, busy_wait);
  Statement(connection, "SELECT count(*) FROM sqlite_schema").run();
}

std::map<std::string, std::string> schema_objects(const Connection& connection) {
  std::map<std::string, std::string> objects;
  Statement query(connection, "SELECT name, sql FROM sqlite_schema WHERE sql IS NOT NULL");
  while (query.step()) objects[query.text(0)] = query.text(1);
  return objects;
}

/// Tables and views of others are left alone; pirt's own must be exactly those of schema.sql.
void check_schema(const Connection& connection) {
  Connection fresh(":memory:", Connection::Mode::kCreate, Nanos(0));
  fresh.run(schema_text());
  const auto actual = schema_objects(connection);
  for (const auto& [name, sql] : schema_objects(fresh)) {
    const auto it = actual.find(name);
    if (it == actual.end()) connection.fail_damaged(fmt::format("'{}' is missing", name));
    if (it->second != sql) {
      connection.fail_damaged(fmt::format("the definition of '{}' was changed", name));
    }
  }
}

void check_structure(const Connection& connection) {
  Statement integrity(connection, "PRAGMA integrity_check(1)");
  if (!integrity.step() || integrity.text(0) != "ok") connection.fail_damaged(integrity.text(0));
  check_schema(connection);
  Statement references(connection, "PRAGMA foreign_key_check");
  if (references.step()) {
    connection.fail_damaged(fmt::format("a row of '{}' refers to nothing", references.text(0)));
  }
}

std::int64_t checksum(const Connection& connection, std::int64_t id,
                      std::initializer_list<std::string_view> queries) {
  Hash64 hash;
  for (const auto sql : queries) {
    Statement query(connection, sql);
    query.bind(id);
    while (query.step()) query.hash_row(hash);
    hash.add(sql);
  }
  return static_cast<std::int64_t>(hash.value());
}

/// Links @p made to @p path unless something has that name by now; true if it did.
bool link_new(const std::filesystem::path& made, const std::filesystem::path& path) {
  if (::link(made.c_str(), path.c_str()) == 0) return true;
  if (errno == EEXIST) return false;
  // File systems without hard links (FAT): a rename, which is not safe against a second creator in
  // the same instant.
  std::filesystem::rename(made, path);
  return true;
}

}  // namespace

sqlite::Connection open_database(const std::filesystem::path& path, sqlite::Connection::Mode mode,
                                 Nanos busy_wait) {
  identify(path);
  recover(path, busy_wait);
  Connection connection(path, mode, busy_wait);
  check_structure(connection);
  if (mode == Connection::Mode::kReadWrite &&
      sqlite3_db_readonly(connection.handle(), "main") != 0) {
    connection.fail(SQLITE_READONLY);
  }
  return connection;
}

void create_database(const std::filesystem::path& path) {
  auto temporary = path;
  temporary += fmt::format(".tmp{}", ::getpid());
  std::error_code ignored;
  std::filesystem::remove(temporary, ignored);
  try {
    {
      Connection connection(temporary, Connection::Mode::kCreate, Nanos(0));
      connection.run("PRAGMA journal_mode = DELETE; BEGIN; " + schema_text() + "; COMMIT");
    }
    link_new(temporary, path);
  } catch (const Error& error) {
    std::filesystem::remove(temporary, ignored);
    throw Error(error.code(),
                fmt::format("cannot make profile database '{}': {}", path.string(), error.what()));
  } catch (const std::filesystem::filesystem_error& error) {
    std::filesystem::remove(temporary, ignored);
    throw_bad_input(fmt::format("cannot make profile database '{}': {}; give another --db",
                                path.string(), error.code().message()));
  }
  std::filesystem::remove(temporary, ignored);
}

std::int64_t run_checksum(const sqlite::Connection& connection, std::int64_t run_id) {
  return checksum(connection, run_id,
                  {"SELECT run_id, started, finished, platform, seed FROM run WHERE run_id = ?",
                   "SELECT key, value FROM environment WHERE run_id = ? ORDER BY key",
                   "SELECT unit, ordinal, backend, device, device_is_cpu, cores FROM unit "
                   "WHERE run_id = ? ORDER BY unit"});
}

std::int64_t cell_checksum(const sqlite::Connection& connection, std::int64_t cell_id) {
  return checksum(
      connection, cell_id,
      {"SELECT run_id, workload, unit, ops, bytes, verification FROM cell WHERE cell_id = ?",
       "SELECT phase, state, provenance, valid, reasons, notes, samples, median_ns, mad_ns, "
       "p95_ns, "
       "p99_ns, ci_low_ns, ci_high_ns FROM measurement WHERE cell_id = ? ORDER BY phase, state",
       "SELECT phase, state, position, ns FROM measurement JOIN sample USING (measurement_id) "
       "WHERE cell_id = ? ORDER BY phase, state, position",
       "SELECT energy_j, provenance, source, valid, reasons FROM energy WHERE cell_id = ?"});
}

void verify_run(const sqlite::Connection& connection, std::int64_t run_id) {
  Statement run(connection, "SELECT checksum FROM run WHERE run_id = ?");
  run.bind(run_id);
  if (!run.step() || run.integer(0) != run_checksum(connection, run_id)) {
    connection.fail_damaged(fmt::format("checksum of run {}", run_id));
  }
  Statement cells(connection,
                  "SELECT cell_id, workload, unit, checksum FROM cell WHERE run_id = ?");
  cells.bind(run_id);
  while (cells.step()) {
    if (cells.integer(3) != cell_checksum(connection, cells.integer(0))) {
      connection.fail_damaged(
          fmt::format("checksum of {} on {} in run {}", cells.text(1), cells.text(2), run_id));
    }
  }
}

}  // namespace pirt
