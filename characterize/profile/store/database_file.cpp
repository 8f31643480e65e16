#include "characterize/profile/store/database_file.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>
#include <new>
#include <span>
#include <system_error>

#include "characterize/profile/store/database_format.h"
#include "workloads/base/error.h"
#include "workloads/base/system/file_descriptor.h"
#include "workloads/base/system/temporary.h"
#include "workloads/base/text/shell.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using sqlite::Connection;
using sqlite::Statement;

constexpr std::size_t kHeaderBytes = 100;

/// Big-endian, as all of SQLite's header. @source https://www.sqlite.org/fileformat2.html,
/// section 1.3.
std::uint32_t header_word(std::span<const unsigned char> header, std::size_t offset) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | header[offset + i];
  return value;
}

void check_version(const std::string& name, std::int64_t version) {
  if (version >= kOldestVersion && version <= kDatabaseVersion) return;
  throw_bad_input(fmt::format(
      "profile database '{}' is of version {}, and this pirt reads version {}: {}", name, version,
      kDatabaseVersion,
      version > kDatabaseVersion ? "use a newer pirt" : "characterize again, into a new file"));
}

/// What is on a medium that is read alone is not, not even to root.
bool may_be_written(const std::filesystem::path& path) {
  const auto file = follow_links(path);
  const auto folder = file.has_parent_path() ? file.parent_path() : ".";
  return ::access(file.c_str(), W_OK) == 0 && ::access(folder.c_str(), W_OK) == 0;
}

/// Checks by its first bytes what a file is, before SQLite, which would take an empty file for an
/// empty database, sees it.
void identify(const std::filesystem::path& path) {
  const std::string name = path.string();
  std::error_code failed;
  const auto status = std::filesystem::status(path, failed);
  if (failed && status.type() != std::filesystem::file_type::not_found) {
    throw_bad_input(
        fmt::format("cannot read profile database '{}': {}; give a path that you may read", name,
                    failed.message()));
  }
  if (!std::filesystem::exists(status)) {
    throw_bad_input(
        fmt::format("there is no profile database '{}'; make one with: pirt characterize --db {}",
                    name, path_in_shell(name)));
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
  check_version(name, header_word(header, 60));
  if (header[18] != 1 || header[19] != 1) {
    const bool stays = may_be_written(path);
    const std::string there = path_in_shell((stays ? path : path.filename()).string());
    throw_bad_input(
        fmt::format("profile database '{}' is not in journal mode DELETE; {}: sqlite3 {} 'PRAGMA "
                    "journal_mode=DELETE'",
                    name,
                    stays ? "convert it with"
                          : fmt::format("it cannot be converted where nothing may be written: copy "
                                        "it (cp {}* FOLDER), and there",
                                        path_in_shell(name)),
                    there));
  }
}

/// A writer that was killed in a transaction leaves a journal; only a connection that may write can
/// roll it back. Of others SQLite knows whether it is that, or of a writer that lives.
void recover(const std::filesystem::path& path, const FileWait& waiting) {
  auto journal = follow_links(path);
  journal += "-journal";
  std::error_code failed;
  const auto size = std::filesystem::file_size(journal, failed);
  if (failed || size == 0) return;
  using Mode = Connection::Mode;
  const Connection connection(path, may_be_written(path) ? Mode::kReadWrite : Mode::kReadOnly,
                              waiting);
  Statement(connection, "SELECT count(*) FROM sqlite_schema").run();
}

/// Who else makes a database in the same folder waits while this lives; where a file system has no
/// such locks nobody does.
class FolderLock {
 public:
  explicit FolderLock(const std::filesystem::path& folder)
      : folder_(::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    while (::flock(folder_.get(), LOCK_EX) != 0 && errno == EINTR) {
    }
  }

 private:
  FileDescriptor folder_;
};

/// What SQLite keeps beside a database would be rolled into any file that takes the database's
/// name: what belonged to one that is gone by now goes first.
void remove_leftovers(const std::filesystem::path& path) {
  for (const auto* suffix : kSideFiles) {
    auto leftover = path;
    leftover += suffix;
    std::filesystem::remove(leftover);
  }
}

/// Of a file that must not be written.
Connection copy_in_memory(const Connection& file) {
  Connection copy(file.path(), Connection::Mode::kMemory, Nanos(0));
  sqlite3_backup* backup = sqlite3_backup_init(copy.handle(), "main", file.handle(), "main");
  if (backup == nullptr) copy.fail(sqlite3_errcode(copy.handle()));
  const int code = sqlite3_backup_step(backup, -1);
  sqlite3_backup_finish(backup);  // which does not repeat that the file is busy
  if (code != SQLITE_DONE) file.fail(code);
  return copy;
}

/// The bytes of the file that a new database is.
std::string new_database(const std::filesystem::path& path) {
  Connection connection(path, Connection::Mode::kMemory, Nanos(0));
  connection.run("BEGIN; " + std::string(database_schema()) + "; COMMIT");
  sqlite3_int64 size = 0;
  const std::unique_ptr<unsigned char, decltype(&sqlite3_free)> bytes(
      sqlite3_serialize(connection.handle(), "main", &size, 0), sqlite3_free);
  if (!bytes) throw std::bad_alloc();
  return {reinterpret_cast<const char*>(bytes.get()), static_cast<std::size_t>(size)};
}

}  // namespace

sqlite::Connection open_database(const std::filesystem::path& path, sqlite::Connection::Mode mode,
                                 const FileWait& waiting) {
  identify(path);
  recover(path, waiting);
  Connection connection(path, mode, waiting);
  // One state of the file, though another program may be appending a run.
  connection.run("BEGIN");
  verify_all(connection);
  connection.run("COMMIT");
  if (mode == Connection::Mode::kReadWrite &&
      sqlite3_db_readonly(connection.handle(), "main") != 0) {
    connection.fail(SQLITE_READONLY);
  }
  if (version_of(connection) != kDatabaseVersion) {
    if (mode == Connection::Mode::kReadOnly) connection = copy_in_memory(connection);
    upgrade(connection);
  }
  return connection;
}

void create_database(const std::filesystem::path& path) {
  try {
    remove_left_beside(path);
    TemporaryFile made(path);
    made.write(new_database(path));
    made.check_written();
    // Of two creators the second must find the first one's file, and not its journal.
    const FolderLock lock(path.parent_path());
    std::error_code ignored;
    if (std::filesystem::exists(std::filesystem::symlink_status(path, ignored))) return;
    remove_leftovers(path);
    made.publish_if_new();
  } catch (const Error& error) {
    throw Error(error.code(),
                fmt::format("cannot make profile database '{}': {}; give another --db",
                            path.string(), error.what()));
  } catch (const std::filesystem::filesystem_error& error) {
    throw_bad_input(fmt::format("cannot make profile database '{}': {}; give another --db",
                                path.string(), error.code().message()));
  }
}

}  // namespace pirt
