#include "characterize/database_migration.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <string>
#include <utility>
#include <vector>

#include "characterize/database_format.h"
#include "characterize/environment.h"
#include "schema_files.h"
#include "workloads/base/embedded.h"
#include "workloads/base/error.h"
#include "workloads/base/text.h"

namespace pirt {
namespace {

using sqlite::Connection;
using sqlite::Statement;
using sqlite::Transaction;

std::vector<std::int64_t> ids(const Connection& connection, std::string_view sql) {
  std::vector<std::int64_t> found;
  Statement query(connection, sql);
  while (query.step()) found.push_back(query.integer(0));
  return found;
}

void set_checksums(const Connection& connection, const DatabaseFormat& format) {
  Statement run(connection, "UPDATE run SET checksum = ? WHERE run_id = ?");
  for (const auto id : ids(connection, "SELECT run_id FROM run")) {
    run.bind(run_checksum(connection, id, format)).bind(id).run();
  }
  Statement cell(connection, "UPDATE cell SET checksum = ? WHERE cell_id = ?");
  for (const auto id : ids(connection, "SELECT cell_id FROM cell")) {
    cell.bind(cell_checksum(connection, id, format)).bind(id).run();
  }
}

void set_fact_kinds(const Connection& connection) {
  std::vector<std::string> keys;
  Statement query(connection, "SELECT DISTINCT key FROM environment");
  while (query.step()) keys.push_back(query.text(0));
  Statement update(connection, "UPDATE environment SET kind = ? WHERE key = ?");
  for (const auto& key : keys) update.bind(to_string(fact_kind(key))).bind(key).run();
}

/// Moves the tables of @p format from `main` to the attached database `old`.
void set_aside(Connection& connection, const DatabaseFormat& format) {
  Connection reference(":memory:", Connection::Mode::kCreate, Nanos(0));
  reference.run(std::string(format.schema));
  // Views first: "view" is behind "table".
  Statement objects(reference,
                    "SELECT type, name FROM sqlite_schema WHERE type IN ('table', 'view') "
                    "ORDER BY type DESC");
  while (objects.step()) {
    const std::string type = objects.text(0);
    const std::string name = objects.text(1);
    if (type == "table") {
      connection.run(fmt::format("CREATE TABLE old.{0} AS SELECT * FROM main.{0}", name));
    }
    connection.run(fmt::format("DROP {} main.{}", type, name));
  }
}

/// Step by step to the present version; in a transaction, with `old` attached, references not
/// enforced.
void migrate(Connection& connection) {
  for (auto version = stored_version(connection); version < kDatabaseVersion; ++version) {
    const auto& next = database_format(version + 1);
    set_aside(connection, database_format(version));
    connection.run(std::string(next.schema));
    const auto step = fmt::format("v{}_to_v{}.sql", version, version + 1);
    connection.run(std::string(find_embedded(schema_files::files(), step).value()));
    if (next.version == 2) set_fact_kinds(connection);
    set_checksums(connection, next);
    Statement tables(connection, "SELECT name FROM old.sqlite_schema WHERE type = 'table'");
    std::vector<std::string> done;
    while (tables.step()) done.push_back(tables.text(0));
    for (const auto& name : done) connection.run(fmt::format("DROP TABLE old.{}", name));
  }
  check_structure(connection);
}

void sync_folder(const std::filesystem::path& path) {
  const auto folder = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;  // a folder that may be written but not read: nothing can be done
  ::fsync(descriptor);
  ::close(descriptor);
}

/// Gives @p made a name that is free, or removes it where a copy of the same bytes is there already
/// (a migration that was killed made it).
void keep_backup(const std::filesystem::path& made, const std::filesystem::path& wished) {
  for (int i = 1;; ++i) {
    auto name = wished;
    if (i > 1) name += std::to_string(i);
    if (!std::filesystem::exists(std::filesystem::symlink_status(name))) {
      std::filesystem::rename(made, name);
      sync_folder(name);
      return;
    }
    if (std::filesystem::is_regular_file(name) &&
        read_file(name, kAnySize) == read_file(made, kAnySize)) {
      std::filesystem::remove(made);
      return;
    }
  }
}

/// The caller holds the write lock, so that the file stays as it is and nobody else makes a copy.
void back_up(const std::filesystem::path& path, std::int64_t version, Nanos busy_wait) {
  auto backup = path;
  backup += fmt::format(".v{}.bak", version);
  auto temporary = backup;
  temporary += ".tmp";
  try {
    std::filesystem::remove(temporary);
    {
      const Connection source(path, Connection::Mode::kReadOnly, busy_wait);
      const Connection copy(temporary, Connection::Mode::kCreate, Nanos(0));
      sqlite::copy_database(source, copy);
    }
    keep_backup(temporary, backup);
  } catch (const std::exception& error) {
    std::error_code ignored;
    std::filesystem::remove(temporary, ignored);
    const std::string message = fmt::format(
        "cannot keep a copy of '{}' as '{}' before bringing it to format {}: {}; "
        "nothing was changed",
        path.string(), backup.string(), kDatabaseVersion, error.what());
    const auto* known = dynamic_cast<const Error*>(&error);
    throw Error(known != nullptr ? known->code() : ErrorCode::kBadInput, message);
  }
}

}  // namespace

std::int64_t stored_version(const Connection& connection) {
  Statement query(connection, "PRAGMA main.user_version");
  return query.step() ? query.integer(0) : 0;
}

Connection migrated_copy(Connection& source) {
  // Nothing damaged may go on with a checksum that is right.
  verify_all(source, database_format(stored_version(source)));
  Connection copy(source.path(), Connection::Mode::kMemory, Nanos(0));
  sqlite::copy_database(source, copy);
  copy.run("PRAGMA foreign_keys = OFF; ATTACH ':memory:' AS old");
  Transaction transaction(copy);
  migrate(copy);
  transaction.commit();
  copy.run("DETACH old; PRAGMA foreign_keys = ON");
  return copy;
}

void migrate_file(Connection& connection, Nanos busy_wait) {
  connection.run("PRAGMA foreign_keys = OFF; ATTACH ':memory:' AS old");
  {
    Transaction transaction(connection);
    const auto version = stored_version(connection);
    if (version < kDatabaseVersion) {
      verify_all(connection, database_format(version));
      back_up(connection.path(), version, busy_wait);
      migrate(connection);
      transaction.commit();
    }
  }
  connection.run("DETACH old; PRAGMA foreign_keys = ON");
}

}  // namespace pirt
