// ROS 2's recording: a database of SQLite whose messages are CDR.
//
// @source  rosbag2_storage_sqlite3: tables topics (id, name, type, serialization_format, ...) and
// messages (id, topic_id, timestamp, data). Read: all versions; written: the first, which has no
// table of versions.
#include <fmt/core.h>
#include <sqlite3.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/system/temporary.h"
#include "workloads/base/text/shell.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/recording/random_file.h"
#include "workloads/inputs/recording/recording.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

class Database {
 public:
  /// @param name  For messages.
  /// @param file  As SQLite wants it, which may be a URI.
  Database(std::string name, const std::string& file, int flags) : file_(std::move(name)) {
    sqlite3* opened = nullptr;
    const int code = sqlite3_open_v2(file.c_str(), &opened, flags, nullptr);
    handle_.reset(opened);
    if (code != SQLITE_OK) fail();
  }
  [[noreturn]] void fail() const {
    const bool is_damaged = handle_ && sqlite3_errcode(handle_.get()) == SQLITE_CORRUPT;
    throw_bad_input("'" + file_ + "' is no whole recording of ROS 2: " +
                    (handle_ ? sqlite3_errmsg(handle_.get()) : "no memory") +
                    (is_damaged ? "; copy it again, or save what is whole: sqlite3 " +
                                      path_in_shell(file_) + " .recover | sqlite3 saved.db3"
                                : ""));
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

/// As SQLite wants the name of a file that nobody writes any more: it takes no lock, and leaves
/// nothing beside it.
std::string immutable_uri(const fs::path& file) {
  std::string uri = "file:";
  for (const char c : fs::absolute(file).string()) {
    const bool plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '/' || c == '.';
    uri += plain ? std::string(1, c) : fmt::format("%{:02x}", static_cast<unsigned char>(c));
  }
  return uri + "?immutable=1";
}

class Db3 final : public Recording {
 public:
  Db3(const fs::path& file, const Opening& as)
      : Recording(as.name.empty() ? file.string() : as.name) {
    static_cast<void>(RandomFile(file, file_));  // refuses what is empty, no file, or a pointer
    open(file);
    guard();
    std::map<std::int64_t, std::size_t> topics;
    Statement of(*database_, "SELECT id, name, type, serialization_format FROM topics");
    while (of.step()) {
      topics[of.number(0)] =
          add({.name = of.bytes(1), .type = ros1_type(of.bytes(2)), .encoding = of.bytes(3)});
    }
    Statement rows(*database_, "SELECT id, topic_id, timestamp FROM messages ORDER BY id");
    while (rows.step()) {
      const auto topic = topics.find(rows.number(1));
      if (topic == topics.end()) fail("is damaged: a message is of no topic");
      if (rows.number(2) < 0) fail("is damaged: a message was recorded before 1970");
      topics_[topic->second].places.push_back(
          {Nanos(rows.number(2)), static_cast<std::uint64_t>(rows.number(0)), 0});
    }
    finish();
  }

 private:
  /// Of the first bytes of a blob only their pages are read.
  [[nodiscard]] std::string load(const Topic::Place& place, std::uint64_t most) const override {
    const std::lock_guard lock(mutex_);
    Statement row(*database_, "SELECT substr(data, 1, ?) FROM messages WHERE id = ?");
    row.bind(1, static_cast<std::int64_t>(std::min(most, kMostChunkBytes)));
    row.bind(2, static_cast<std::int64_t>(place.at));
    if (!row.step()) fail("has changed while it was read");
    return row.bytes(0);
  }

  /// A recorder that was killed leaves what it had not put into the file beside it: with that it is
  /// whole, in a copy, since the folder may be one that nobody may write.
  void open(const fs::path& file) {
    std::error_code failed;
    std::vector<fs::path> beside;
    for (const char* ending : {"-wal", "-journal"}) {
      const fs::path other = file.string() + ending;
      if (fs::exists(other, failed) && fs::file_size(other, failed) > 0) beside.push_back(other);
    }
    if (beside.empty()) {
      database_.emplace(file_, immutable_uri(file),
                        SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_URI);
      return;
    }
    auto copy = recording_folder();
    beside.push_back(file);
    for (const fs::path& each : beside) {
      fs::copy_file(each, copy->path() / each.filename(), failed);
      if (!failed) continue;
      throw_environment("'" + each.string() + "' is copied to be read, and that fails: " +
                        failed.message() + "; name a folder with more room: TMPDIR=FOLDER");
    }
    database_.emplace(file_, (copy->path() / file.filename()).string(),
                      SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX);
    own(std::move(copy));
  }

  /// The file is somebody else's: a view or a column may be a program.
  void guard() const {
    sqlite3* const handle = database_->get();
    for (const int off : {SQLITE_DBCONFIG_TRUSTED_SCHEMA, SQLITE_DBCONFIG_ENABLE_TRIGGER,
                          SQLITE_DBCONFIG_ENABLE_VIEW}) {
      sqlite3_db_config(handle, off, 0, nullptr);
    }
    sqlite3_db_config(handle, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, static_cast<int>(kMostChunkBytes));
    Statement tables(*database_,
                     "SELECT (SELECT count(*) FROM sqlite_master WHERE type = 'table'"
                     "  AND name IN ('topics', 'messages') AND sql NOT LIKE 'CREATE VIRTUAL%'),"
                     " (SELECT count(*) FROM pragma_table_xinfo('topics') WHERE hidden <> 0),"
                     " (SELECT count(*) FROM pragma_table_xinfo('messages') WHERE hidden <> 0)");
    tables.step();
    if (tables.number(0) != 2 || tables.number(1) != 0 || tables.number(2) != 0) {
      fail("is no recording of ROS 2: it has no tables 'topics' and 'messages' of plain columns");
    }
  }

  std::optional<Database> database_;
  mutable std::mutex mutex_;  ///< Of the database, which has none.
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
        database_(std::in_place, file.string(), (folder_.path() / "recording.db3").string(),
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

std::unique_ptr<Recording> open_db3(const fs::path& file, const Opening& as) {
  return std::make_unique<Db3>(file, as);
}

std::unique_ptr<RecordingWriter> make_db3(const fs::path& file) {
  return std::make_unique<Db3Writer>(file);
}

}  // namespace pirt
