#include "characterize/profile/store/sqlite.h"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <thread>

#include "workloads/base/error.h"
#include "workloads/base/text/shell.h"
#include "workloads/base/text/text.h"

namespace pirt::sqlite {
namespace {

int open_flags(Connection::Mode mode) {
  switch (mode) {
    case Connection::Mode::kReadOnly:
      return SQLITE_OPEN_READONLY;
    case Connection::Mode::kReadWrite:
      return SQLITE_OPEN_READWRITE;
    case Connection::Mode::kMemory:
      return SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
  }
  return SQLITE_OPEN_READONLY;
}

/// ":memory:" and, where it is built so, "file:..." are names to SQLite: only where a path begins.
std::string file_name(const std::filesystem::path& path) {
  return (path.is_relative() ? "." / path : path).string();
}

}  // namespace

/// One wait after the other, for as long as each is to take.
struct Connection::Wait {
  static constexpr Nanos kStep = std::chrono::milliseconds(10);
  static constexpr Nanos kUntilNotice = std::chrono::seconds(1);
  /// For whoever only reads: what was measured is worth as much after a signal, too.
  static constexpr Nanos kAfterStop = std::chrono::seconds(2);

  FileWait waiting;
  std::string path;
  sqlite3* handle = nullptr;
  MachineClock clock;
  Nanos begun{0}, stopped{0}, waited{0};
  bool noticed = false, given_up = false;

  /// SQLite's busy handler. @param times  How often it was called for this lock.
  /// @return 0 to give up.
  static int again(void* wait, int times) { return static_cast<Wait*>(wait)->again(times); }

  int again(int times) {
    const Nanos now = clock.now();
    if (times == 0) {
      begun = now;
      stopped = Nanos(0);
      noticed = false;
    }
    waited = now - begun;
    if (waiting.stop != nullptr && waiting.stop->load()) {
      if (stopped == Nanos(0)) stopped = now;
      given_up = now - stopped >= kAfterStop;
      if (given_up) return 0;
    }
    if (waiting.longest && waited >= *waiting.longest) return 0;
    if (waited >= kUntilNotice && !noticed && waiting.notice) {
      noticed = true;
      // Whoever has begun to write waits for readers only.
      const bool writes = sqlite3_txn_state(handle, "main") == SQLITE_TXN_WRITE;
      waiting.notice(
          fmt::format("waiting for another program that {} {}", writes ? "reads" : "writes", path));
    }
    std::this_thread::sleep_for(kStep);
    return 1;
  }
};

Connection::Connection(std::filesystem::path path, Mode mode, FileWait waiting)
    : path_(std::move(path)), wait_(std::make_shared<Wait>()) {
  wait_->waiting = std::move(waiting);
  wait_->path = path_.string();
  sqlite3* handle = nullptr;
  const std::string name = mode == Mode::kMemory ? ":memory:" : file_name(path_);
  const int code =
      sqlite3_open_v2(name.c_str(), &handle, open_flags(mode) | SQLITE_OPEN_NOMUTEX, nullptr);
  handle_.reset(handle);
  wait_->handle = handle;
  if (code != SQLITE_OK) fail(code);
  sqlite3_extended_result_codes(handle, 1);
  sqlite3_busy_handler(handle, &Wait::again, wait_.get());
  sqlite3_db_config(handle, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  run("PRAGMA foreign_keys = ON; PRAGMA trusted_schema = OFF; PRAGMA temp_store = MEMORY");
}

void Connection::run(const std::string& sql) {
  const int code = sqlite3_exec(handle(), sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) fail(code);
}

void Connection::fail(int code) const {
  const std::string path = path_.string();
  // The connection's last message may be of another error, or of none ("not an error").
  const bool last = handle_ && (sqlite3_errcode(handle()) & 0xFF) == (code & 0xFF);
  const std::string detail = last ? sqlite3_errmsg(handle()) : sqlite3_errstr(code);
  switch (code & 0xFF) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      throw_environment(
          wait_->given_up
              ? fmt::format("interrupted while another program used profile database '{}' (waited "
                            "{:.3g} s); what was stored before is kept",
                            path, to_s(wait_->waited))
              : fmt::format("profile database '{}' is in use by another program (waited {:.3g} s); "
                            "try again when that has ended, or give another --db",
                            path, to_s(wait_->waiting.longest.value_or(wait_->waited))));
    case SQLITE_FULL:
      throw_environment(fmt::format(
          "no space left to write profile database '{}'; what was stored before is kept: free "
          "some space and run again",
          path));
    case SQLITE_IOERR:
      throw_environment(
          fmt::format("cannot read or write profile database '{}' ({}); what was stored before is "
                      "kept: check the disk and its limits, and run again",
                      path, detail));
    case SQLITE_READONLY:
      if (code == SQLITE_READONLY_ROLLBACK) {
        auto journal = follow_links(path_);
        journal += "-journal";
        throw_bad_input(fmt::format(
            "the last writer of profile database '{}' was killed; what puts it right is '{}', and "
            "nothing may be written there: copy both (cp {} {} FOLDER), and give the copy",
            path, journal.string(), path_in_shell(path), path_in_shell(journal.string())));
      }
      throw_bad_input(
          fmt::format("profile database '{}' cannot be written ({}); make the file and "
                      "its folder writable, or give another --db",
                      path, detail));
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
    case SQLITE_AUTH:
      throw_bad_input(
          fmt::format("cannot open profile database '{}' ({}); check that the path is right and "
                      "that the file and its folder permit it",
                      path, detail));
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      fail_damaged(detail);
    default:
      throw_environment(
          fmt::format("profile database '{}': {} (SQLite error {})", path, detail, code));
  }
}

void Connection::fail_damaged(std::string_view detail) const {
  throw_bad_input(
      fmt::format("profile database '{}' is damaged ({}); restore a copy, or characterize again "
                  "into a new file",
                  path_.string(), detail));
}

Statement::Statement(const Connection& connection, std::string_view sql) : connection_(connection) {
  sqlite3_stmt* statement = nullptr;
  const int code = sqlite3_prepare_v2(connection.handle(), sql.data(), static_cast<int>(sql.size()),
                                      &statement, nullptr);
  statement_.reset(statement);
  // The statements are pirt's own: one that the file's schema does not fit means that the schema is
  // not what it should be.
  if ((code & 0xFF) == SQLITE_ERROR) {
    connection.fail_damaged(sqlite3_errmsg(connection.handle()));
  }
  check(code);
}

void Statement::check(int code) {
  if (code != SQLITE_OK) connection_.fail(code);
}

Statement& Statement::bind(std::int64_t value) {
  check(sqlite3_bind_int64(statement_.get(), next_++, value));
  return *this;
}

Statement& Statement::bind(double value) {
  check(sqlite3_bind_double(statement_.get(), next_++, value));
  return *this;
}

Statement& Statement::bind(std::string_view value) {
  check(sqlite3_bind_text(statement_.get(), next_++, value.data(), static_cast<int>(value.size()),
                          SQLITE_TRANSIENT));
  return *this;
}

Statement& Statement::bind_null() {
  check(sqlite3_bind_null(statement_.get(), next_++));
  return *this;
}

bool Statement::step() {
  const int code = sqlite3_step(statement_.get());
  if (code == SQLITE_ROW) return true;
  if (code != SQLITE_DONE) connection_.fail(code);
  return false;
}

void Statement::run() {
  while (step()) {
  }
  sqlite3_reset(statement_.get());
  next_ = 1;
}

std::int64_t Statement::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

double Statement::real(int column) const { return sqlite3_column_double(statement_.get(), column); }

std::string Statement::text(int column) const {
  const auto* data = sqlite3_column_text(statement_.get(), column);
  if (data == nullptr) return "";
  return {reinterpret_cast<const char*>(data),
          static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

bool Statement::is_null(int column) const {
  return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL;
}

std::optional<std::int64_t> Statement::optional_integer(int column) const {
  return is_null(column) ? std::nullopt : std::optional(integer(column));
}

std::optional<Nanos> Statement::optional_nanos(int column) const {
  return is_null(column) ? std::nullopt : std::optional(Nanos(integer(column)));
}

void Statement::hash_row(Hash64& hash) const {
  const int columns = sqlite3_column_count(statement_.get());
  for (int i = 0; i < columns; ++i) {
    const int type = sqlite3_column_type(statement_.get(), i);
    hash.add(static_cast<std::uint64_t>(type));
    if (type == SQLITE_INTEGER) hash.add(static_cast<std::uint64_t>(integer(i)));
    if (type == SQLITE_FLOAT) hash.add(std::bit_cast<std::uint64_t>(real(i)));
    if (type == SQLITE_TEXT) hash.add(text(i));
  }
}

Transaction::Transaction(Connection& connection) : connection_(connection) {
  // IMMEDIATE: a second writer is met here, before anything was done, and waited for.
  connection_.run("BEGIN IMMEDIATE");
}

Transaction::~Transaction() {
  // Some errors (a full disk) have rolled back already. Nothing can be done about a failing
  // rollback: the journal then undoes it at the next opening.
  if (connection_.in_transaction()) {
    sqlite3_exec(connection_.handle(), "ROLLBACK", nullptr, nullptr, nullptr);
  }
}

void Transaction::commit() { connection_.run("COMMIT"); }

}  // namespace pirt::sqlite
