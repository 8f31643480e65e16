// The little of SQLite that the profile database needs, with errors translated to pirt::Error.
// Private to characterize/.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "characterize/profile/store/file_wait.h"
#include "workloads/base/hash.h"
#include "workloads/base/time.h"

namespace pirt::sqlite {

/// One connection. Every failure throws: kBadInput for what is wrong with the file, kEnvironment
/// for what is wrong with the machine (busy, full, input/output); the message names the path and
/// the remedy.
class Connection {
 public:
  enum class Mode {
    kReadOnly,
    kReadWrite,
    kMemory  ///< A database of its own in memory; the path only stands in messages.
  };

  /// @param path       A file's, whatever it looks like: ":memory:" and "file:p.db" are files too.
  /// @param waiting  How others who use the file are waited for.
  Connection(std::filesystem::path path, Mode mode, FileWait waiting);

  /// Runs one or several statements without results.
  void run(const std::string& sql);
  [[nodiscard]] std::int64_t last_row_id() const { return sqlite3_last_insert_rowid(handle()); }
  [[nodiscard]] bool in_transaction() const { return sqlite3_get_autocommit(handle()) == 0; }
  [[nodiscard]] sqlite3* handle() const { return handle_.get(); }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

  [[noreturn]] void fail(int code) const;
  [[noreturn]] void fail_damaged(std::string_view detail) const;

 private:
  struct Close {
    void operator()(sqlite3* handle) const { sqlite3_close_v2(handle); }
  };
  struct Wait;
  std::filesystem::path path_;
  std::shared_ptr<Wait> wait_;  ///< Where SQLite finds it, whoever has the connection.
  std::unique_ptr<sqlite3, Close> handle_;
};

/// One prepared statement; its connection must outlive it. Parameters and columns are used in
/// order.
class Statement {
 public:
  Statement(const Connection& connection, std::string_view sql);

  Statement& bind(std::int64_t value);
  Statement& bind(double value);
  Statement& bind(std::string_view value);
  Statement& bind(const char* value) { return bind(std::string_view(value)); }
  template <typename T>
  Statement& bind(const std::optional<T>& value) {
    return value ? bind(*value) : bind_null();
  }
  Statement& bind(Nanos value) { return bind(value.count()); }
  Statement& bind_null();

  /// Advances to the next row; false at the end.
  bool step();
  /// Runs a statement without rows and makes it ready for the next values.
  void run();

  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] double real(int column) const;
  [[nodiscard]] std::string text(int column) const;
  [[nodiscard]] bool is_null(int column) const;
  [[nodiscard]] std::optional<std::int64_t> optional_integer(int column) const;
  [[nodiscard]] std::optional<Nanos> optional_nanos(int column) const;
  /// Adds types and values of the current row.
  void hash_row(Hash64& hash) const;

 private:
  void check(int code);
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  const Connection& connection_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
  int next_ = 1;
};

/// Rolls back at the end of its scope unless committed.
class Transaction {
 public:
  explicit Transaction(Connection& connection);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  void commit();

 private:
  Connection& connection_;
};

}  // namespace pirt::sqlite
