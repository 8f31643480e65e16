// ROS 2's recording: a database of SQLite whose messages are CDR.
//
// @source  rosbag2_storage_sqlite3: tables topics (id, name, type, serialization_format, ...) and
// messages (id, topic_id, timestamp, data). Read: all versions; written: the first, which has no
// table of versions.
#include <fmt/core.h>
#include <sqlite3.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <optional>

#include "workloads/base/error.h"
#include "workloads/base/system/temporary.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/recording/recording.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

/// "sensor_msgs/msg/Image" <-> "sensor_msgs/Image".
std::string ros1_type(const std::string& type) {
  const auto at = type.find("/msg/");
  return at == std::string::npos ? type : type.substr(0, at) + type.substr(at + 4);
}
std::string ros2_type(std::string_view type) {
  const auto slash = type.find('/');
  return std::string(type.substr(0, slash)) + "/msg" + std::string(type.substr(slash));
}

class Database {
 public:
  Database(const fs::path& file, int flags) : file_(file.string()) {
    sqlite3* opened = nullptr;
    const int code = sqlite3_open_v2(file.c_str(), &opened, flags, nullptr);
    handle_.reset(opened);
    if (code != SQLITE_OK) fail();
  }
  [[noreturn]] void fail() const {
    throw_bad_input("'" + file_ + "' is no whole recording of ROS 2: " +
                    (handle_ ? sqlite3_errmsg(handle_.get()) : "no memory"));
  }
  [[nodiscard]] sqlite3* get() const { return handle_.get(); }

 private:
  struct Close {
    void operator()(sqlite3* handle) const { sqlite3_close(handle); }
  };
  std::string file_;
  std::unique_ptr<sqlite3, Close> handle_;
};

class Statement {
 public:
  Statement(const Database& database, const char* sql) : database_(database) {
    sqlite3_stmt* made = nullptr;
    if (sqlite3_prepare_v2(database.get(), sql, -1, &made, nullptr) != SQLITE_OK) database.fail();
    handle_.reset(made);
  }
  Statement& bind(int at, std::int64_t value) {
    return check(sqlite3_bind_int64(handle_.get(), at, value));
  }
  Statement& bind(int at, std::string_view text) {
    return check(sqlite3_bind_text(handle_.get(), at, text.data(), static_cast<int>(text.size()),
                                   SQLITE_TRANSIENT));
  }
  Statement& bind_bytes(int at, std::string_view bytes) {
    return check(sqlite3_bind_blob(handle_.get(), at, bytes.data(), static_cast<int>(bytes.size()),
                                   SQLITE_TRANSIENT));
  }
  bool step() {
    const int code = sqlite3_step(handle_.get());
    if (code != SQLITE_ROW && code != SQLITE_DONE) database_.fail();
    return code == SQLITE_ROW;
  }
  void reset() { sqlite3_reset(handle_.get()); }
  [[nodiscard]] std::int64_t number(int column) const {
    return sqlite3_column_int64(handle_.get(), column);
  }
  /// Text and blobs alike.
  [[nodiscard]] std::string bytes(int column) const {
    const void* data = sqlite3_column_blob(handle_.get(), column);
    const auto size = static_cast<std::size_t>(sqlite3_column_bytes(handle_.get(), column));
    return data == nullptr ? "" : std::string(static_cast<const char*>(data), size);
  }

 private:
  Statement& check(int code) {
    if (code != SQLITE_OK) database_.fail();
    return *this;
  }
  struct Finalize {
    void operator()(sqlite3_stmt* handle) const { sqlite3_finalize(handle); }
  };
  const Database& database_;
  std::unique_ptr<sqlite3_stmt, Finalize> handle_;
};

class Db3 final : public Recording {
 public:
  explicit Db3(const fs::path& file)
      : Recording(file.string()), database_(file, SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX) {
    std::map<std::string, std::int64_t> ids;
    Statement topics(database_, "SELECT id, name, type, serialization_format FROM topics");
    while (topics.step()) {
      if (const auto format = topics.bytes(3); format != "cdr") {
        fail(fmt::format("has messages of {} as '{}'; only cdr is known", topics.bytes(1), format));
      }
      topics_.push_back({topics.bytes(1), ros1_type(topics.bytes(2)), 0});
      ids[topics_.back().name] = topics.number(0);
    }
    std::ranges::sort(topics_, {}, &Topic::name);
    rows_.resize(topics_.size());
    Statement rows(database_, "SELECT id FROM messages WHERE topic_id = ? ORDER BY timestamp, id");
    for (std::size_t i = 0; i < topics_.size(); ++i) {
      rows.bind(1, ids.at(topics_[i].name));
      while (rows.step()) rows_[i].push_back(rows.number(0));
      rows.reset();
      topics_[i].messages = rows_[i].size();
    }
  }

  [[nodiscard]] WireFormat format() const override { return WireFormat::kCdr; }

  [[nodiscard]] std::string message(std::size_t topic, std::size_t index) const override {
    const std::lock_guard lock(mutex_);
    Statement row(database_, "SELECT data FROM messages WHERE id = ?");
    row.bind(1, rows_[topic][index]);
    if (!row.step()) fail("has changed while it was read");
    return row.bytes(0);
  }

 private:
  Database database_;
  std::vector<std::vector<std::int64_t>> rows_;  ///< By topic.
  mutable std::mutex mutex_;                     ///< Of the database, which has none.
};

void run(const Database& database, const char* sql) {
  if (sqlite3_exec(database.get(), sql, nullptr, nullptr, nullptr) != SQLITE_OK) database.fail();
}

/// In a folder beside the target until it is complete.
class Db3Writer final : public RecordingWriter {
 public:
  explicit Db3Writer(const fs::path& file)
      : target_(follow_links(file)),
        folder_(target_),
        database_(std::in_place, folder_.path() / "recording.db3",
                  SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX) {
    run(*database_,
        "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN;"
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
        " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
        " timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
        "CREATE INDEX timestamp_idx ON messages (timestamp ASC);");
  }

  [[nodiscard]] WireFormat format() const override { return WireFormat::kCdr; }

  void write(const std::string& topic, std::string_view type, Nanos time,
             const std::string& message) override {
    const auto [known, is_new] = ids_.try_emplace(topic, std::ssize(ids_) + 1);
    if (is_new) {
      Statement(*database_, "INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')")
          .bind(1, known->second)
          .bind(2, topic)
          .bind(3, ros2_type(type))
          .step();
    }
    Statement(*database_, "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)")
        .bind(1, known->second)
        .bind(2, time.count())
        .bind_bytes(3, message)
        .step();
  }

  void publish() override {
    run(*database_, "COMMIT");
    database_.reset();
    std::error_code failed;
    fs::rename(folder_.path() / "recording.db3", target_, failed);
    if (failed) throw_bad_input("cannot write '" + target_.string() + "': " + failed.message());
  }

 private:
  fs::path target_;
  TemporaryFolder folder_;
  std::optional<Database> database_;
  std::map<std::string, std::int64_t> ids_;
};

}  // namespace

std::unique_ptr<Recording> open_db3(const fs::path& file) { return std::make_unique<Db3>(file); }

std::unique_ptr<RecordingWriter> make_db3(const fs::path& file) {
  return std::make_unique<Db3Writer>(file);
}

}  // namespace pirt
