// Writing beside a program that reads the same database for a while.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <atomic>

#include "characterize/profile/store/reader.h"
#include "characterize/profile/store/writer.h"
#include "tests/characterize/profile/database_support.h"
#include "tests/characterize/support.h"

namespace pirt {
namespace {

using test::error_of;
using test::small_run;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// An SQLite shell with an open transaction.
class Reader {
 public:
  explicit Reader(const std::filesystem::path& path) {
    EXPECT_EQ(sqlite3_open(path.c_str(), &handle_), SQLITE_OK);
    run("BEGIN; SELECT count(*) FROM run");
  }
  ~Reader() { sqlite3_close(handle_); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  void run(const char* sql) {
    EXPECT_EQ(sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr), SQLITE_OK);
  }

 private:
  sqlite3* handle_ = nullptr;
};

class FileWaiting : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path path() const { return folder_ / "p.db"; }
  /// Of a writer that waits for as long as it takes.
  [[nodiscard]] FileWait patient(const std::function<void()>& meanwhile) {
    FileWait wait;
    wait.longest.reset();
    wait.stop = &stop_;
    wait.notice = [this, meanwhile](const std::string& text) {
      notices_.push_back(text);
      meanwhile();
    };
    return wait;
  }

  test::TemporaryFolder folder_;
  std::atomic<bool> stop_ = false;
  std::vector<std::string> notices_;
};

TEST_F(FileWaiting, LastsUntilTheReaderEndsAndIsSaidOnce) {
  { ProfileWriter(path()).begin_run(small_run()); }
  Reader reader(path());
  ProfileWriter writer(path(), patient([&reader] { reader.run("COMMIT"); }));
  EXPECT_EQ(writer.begin_run(small_run()), 2);
  EXPECT_THAT(notices_, ElementsAre(AllOf(StartsWith("waiting for another program that reads "),
                                          EndsWith("p.db"))));
}

TEST_F(FileWaiting, SaysThatAnotherOneWrites) {
  { ProfileWriter(path()).begin_run(small_run()); }
  Reader other(path());
  other.run("COMMIT; BEGIN IMMEDIATE");
  ProfileWriter writer(path(), patient([&other] { other.run("ROLLBACK"); }));
  writer.begin_run(small_run());
  EXPECT_THAT(notices_, ElementsAre(HasSubstr("another program that writes")));
}

TEST_F(FileWaiting, EndsSoonAfterASignalAndLosesNothingThatWasStored) {
  { ProfileWriter(path()).begin_run(small_run()); }
  Reader reader(path());
  ProfileWriter writer(path(), patient([this] { stop_ = true; }));
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [&] { return writer.begin_run(small_run()); }),
              AllOf(HasSubstr("interrupted while another program used profile database"),
                    HasSubstr("what was stored before is kept")));
  reader.run("COMMIT");
  stop_ = false;
  EXPECT_EQ(writer.begin_run(small_run()), 2);
}

}  // namespace
}  // namespace pirt
