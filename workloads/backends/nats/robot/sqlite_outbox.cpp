#include <fmt/core.h>
#include <sqlite3.h>

#include <filesystem>
#include <utility>

#include "workloads/backends/nats/robot/outbox.h"
#include "workloads/base/error.h"

namespace pirt::cloud {
namespace {

constexpr int kApplication = 0x70695242;  // "piRB"
constexpr int kVersion = 1;
constexpr const char* kSchema = R"(
CREATE TABLE robot (name TEXT NOT NULL) STRICT;
CREATE TABLE task (
  run INTEGER NOT NULL, number INTEGER NOT NULL,
  key TEXT NOT NULL,        -- '' = none
  sends INTEGER NOT NULL, tries INTEGER NOT NULL,
  body BLOB NOT NULL,
  reply BLOB,               -- a frame, where nobody waited for it
  PRIMARY KEY (run, number)
) STRICT;
)";

struct CloseDatabase {
  void operator()(sqlite3* handle) const { sqlite3_close_v2(handle); }
};
struct FinalizeStatement {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};

class File {
 public:
  explicit File(std::filesystem::path path) : path_(std::move(path)) {
    sqlite3* handle = nullptr;
    const std::string name = (path_.is_relative() ? "." / path_ : path_).string();
    const int code = sqlite3_open_v2(
        name.c_str(), &handle, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_FULLMUTEX,
        nullptr);
    handle_.reset(handle);
    check(code);
    sqlite3_extended_result_codes(handle, 1);
    run("PRAGMA locking_mode = EXCLUSIVE; PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL;"
        "PRAGMA trusted_schema = OFF; BEGIN IMMEDIATE; COMMIT;");
  }
  void run(const char* sql) { check(sqlite3_exec(handle_.get(), sql, nullptr, nullptr, nullptr)); }
  void check(int code) const {
    if (code == SQLITE_OK || code == SQLITE_DONE || code == SQLITE_ROW) return;
    const std::string what = fmt::format("outbox '{}'", path_.string());
    const char* detail = handle_ ? sqlite3_errmsg(handle_.get()) : sqlite3_errstr(code);
    switch (code & 0xFF) {
      case SQLITE_BUSY:
      case SQLITE_LOCKED:
        throw_environment(what +
                          " belongs to another program that runs; end it, or name another "
                          "file (outbox:)");
      case SQLITE_NOTADB:
      case SQLITE_CORRUPT:
        throw_bad_input(
            fmt::format("{} is no outbox, or damaged ({}); move it away", what, detail));
      case SQLITE_CANTOPEN:
      case SQLITE_PERM:
      case SQLITE_READONLY:
        throw_bad_input(
            fmt::format("{} cannot be written ({}); make its folder, or name another "
                        "file (outbox:)",
                        what, detail));
      default:
        throw_environment(fmt::format("{}: {}; free some space on its disk", what, detail));
    }
  }
  [[nodiscard]] sqlite3* handle() const { return handle_.get(); }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  std::unique_ptr<sqlite3, CloseDatabase> handle_;
};

class Statement {
 public:
  Statement(File& file, const char* sql) : file_(file) {
    sqlite3_stmt* statement = nullptr;
    file_.check(sqlite3_prepare_v2(file_.handle(), sql, -1, &statement, nullptr));
    statement_.reset(statement);
  }
  Statement& bind(std::uint64_t value) {
    file_.check(sqlite3_bind_int64(statement_.get(), next_++, static_cast<std::int64_t>(value)));
    return *this;
  }
  Statement& bind(const TaskId& task) { return bind(task.run).bind(task.number); }
  Statement& bind(std::string_view text) {
    file_.check(sqlite3_bind_text64(statement_.get(), next_++, text.data(), text.size(),
                                    SQLITE_STATIC, SQLITE_UTF8));
    return *this;
  }
  /// Not null, if it is empty.
  Statement& bind(ByteView bytes) {
    static constexpr std::byte kNothing{};
    file_.check(sqlite3_bind_blob64(statement_.get(), next_++,
                                    bytes.empty() ? &kNothing : bytes.data(), bytes.size(),
                                    SQLITE_STATIC));
    return *this;
  }
  bool step() {
    const int code = sqlite3_step(statement_.get());
    file_.check(code);
    return code == SQLITE_ROW;
  }
  /// To its end; then it may be used again.
  void run() {
    while (step()) continue;
    file_.check(sqlite3_reset(statement_.get()));
    next_ = 1;
  }
  [[nodiscard]] std::uint64_t number(int column) const {
    return static_cast<std::uint64_t>(sqlite3_column_int64(statement_.get(), column));
  }
  [[nodiscard]] Bytes bytes(int column) const {
    const auto* data = static_cast<const std::byte*>(sqlite3_column_blob(statement_.get(), column));
    return {data, data + sqlite3_column_bytes(statement_.get(), column)};
  }
  [[nodiscard]] std::string text(int column) const {
    const Bytes content = bytes(column);
    return {reinterpret_cast<const char*>(content.data()), content.size()};
  }

 private:
  File& file_;
  std::unique_ptr<sqlite3_stmt, FinalizeStatement> statement_;
  int next_ = 1;
};

std::uint64_t pragma(File& file, const char* sql) {
  Statement statement(file, sql);
  return statement.step() ? statement.number(0) : 0;
}

void begin_or_check(File& file, std::string_view robot) {
  const auto application = pragma(file, "PRAGMA application_id");
  const auto version = pragma(file, "PRAGMA user_version");
  if (application == 0 && version == 0 && pragma(file, "SELECT count(*) FROM sqlite_schema") == 0) {
    file.run("BEGIN IMMEDIATE");
    file.run(kSchema);
    Statement(file, "INSERT INTO robot VALUES (?)").bind(robot).run();
    file.run(fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}; COMMIT",
                         kApplication, kVersion)
                 .c_str());
    return;
  }
  const std::string path = file.path().string();
  if (application != kApplication) {
    throw_bad_input("'" + path + "' is a database of something else, no outbox; name another file");
  }
  if (version != kVersion) {
    throw_bad_input(
        fmt::format("outbox '{}' has version {}, and this pirt reads {}; use the pirt "
                    "that wrote it, or name another file",
                    path, version, kVersion));
  }
  Statement owner(file, "SELECT name FROM robot");
  const std::string name = owner.step() ? owner.text(0) : "";
  if (name != robot) {
    throw_bad_input(fmt::format("outbox '{}' is robot '{}''s, not '{}''s; name another file", path,
                                name, robot));
  }
}

class SqliteOutbox final : public Outbox {
 public:
  SqliteOutbox(const std::filesystem::path& path, std::string_view robot, std::uint64_t limit)
      : Outbox(limit), file_(path) {
    begin_or_check(file_, robot);
    Statement all(file_,
                  "SELECT run, number, key, sends, tries, length(body), ifnull(length(reply), 0), "
                  "reply IS NOT NULL FROM task");
    while (all.step()) {
      found({.task = {all.number(0), all.number(1)},
             .key = all.text(2),
             .sends = static_cast<std::uint32_t>(all.number(3)),
             .tries = static_cast<std::uint32_t>(all.number(4)),
             .answered = all.number(7) != 0},
            all.number(5), all.number(6));
    }
    put_.emplace(file_, "INSERT INTO task VALUES (?, ?, ?, ?, 0, ?, NULL)");
    erase_.emplace(file_, "DELETE FROM task WHERE run = ? AND number = ?");
  }
  ~SqliteOutbox() override {
    try {
      change([] {});
    } catch (const std::exception&) {  // What was to be erased is withdrawn when it is opened next.
    }
  }

  Bytes body(const TaskId& task) override { return read(task, "body"); }
  Bytes reply(const TaskId& task) override { return read(task, "reply"); }

 private:
  static constexpr std::size_t kMostErased = 64;

  void keep(const Kept& task, ByteView body) override {
    change([&] {
      put_->bind(task.task)
          .bind(std::string_view(task.key))
          .bind(std::uint64_t{task.sends})
          .bind(body)
          .run();
    });
  }
  void keep_counts(const Kept& task) override {
    change([&] {
      Statement(file_, "UPDATE task SET sends = ?, tries = ? WHERE run = ? AND number = ?")
          .bind(std::uint64_t{task.sends})
          .bind(std::uint64_t{task.tries})
          .bind(task.task)
          .run();
    });
  }
  void keep_reply(const TaskId& task, ByteView reply) override {
    change([&] {
      Statement(file_, "UPDATE task SET reply = ? WHERE run = ? AND number = ?")
          .bind(reply)
          .bind(task)
          .run();
    });
  }
  void drop(const TaskId& task) override {
    erased_.push_back(task);
    if (erased_.size() >= kMostErased) change([] {});
  }

  /// One transaction: what was erased since the last, and @p what.
  template <typename Change>
  void change(const Change& what) {
    file_.run("BEGIN IMMEDIATE");
    try {
      for (const TaskId& task : erased_) erase_->bind(task).run();
      what();
      file_.run("COMMIT");
    } catch (...) {
      sqlite3_exec(file_.handle(), "ROLLBACK", nullptr, nullptr, nullptr);
      put_.emplace(file_, "INSERT INTO task VALUES (?, ?, ?, ?, 0, ?, NULL)");
      erase_.emplace(file_, "DELETE FROM task WHERE run = ? AND number = ?");
      throw;
    }
    erased_.clear();
  }
  Bytes read(const TaskId& task, const char* column) {
    if (!holds(task)) return {};
    Statement read(file_,
                   fmt::format("SELECT {} FROM task WHERE run = ? AND number = ?", column).c_str());
    read.bind(task);
    return read.step() ? read.bytes(0) : Bytes{};
  }

  File file_;
  std::vector<TaskId> erased_;
  std::optional<Statement> put_, erase_;
};

}  // namespace

std::unique_ptr<Outbox> open_outbox(const std::filesystem::path& file, std::string_view robot,
                                    std::uint64_t limit_bytes) {
  return std::make_unique<SqliteOutbox>(file, robot, limit_bytes);
}

}  // namespace pirt::cloud
