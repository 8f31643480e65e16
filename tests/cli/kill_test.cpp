// pirt characterize killed with -9 at random moments: its database always opens, what it
// acknowledged is there, and
// --resume completes it; also after the database was removed, whatever the kill left beside it. A
// seeded subset; all 500 kills with tests/run.sh --long.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>

#include <chrono>
#include <set>
#include <thread>

#include "tests/cli/program.h"
#include "tests/support/long.h"
#include "tests/support/paths.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/text.h"

namespace pirt::test {
namespace {

using testing::IsSubsetOf;
using testing::SizeIs;

constexpr std::size_t kCells = 6;  // two workloads on three units

class Kill : public testing::Test {
 protected:
  [[nodiscard]] std::string database() const { return scratch_.file("p.db"); }

  /// Starts a run, or goes on with one.
  [[nodiscard]] pid_t start(bool resume) const {
    std::vector<std::string> words = {kProgram, "characterize", "--db", database()};
    const std::vector<std::string> rest =
        resume ? std::vector<std::string>{"--resume"}
               : std::vector<std::string>{"--quick", "--platform", "fake", "--filter",
                                          "^(pool5|fc8)$"};
    words.insert(words.end(), rest.begin(), rest.end());
    std::vector<char*> arguments;
    for (auto& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    const std::string log = scratch_.file("log");
    const pid_t child = ::fork();
    if (child != 0) return child;
    ::setenv("TMPDIR", scratch_.file("").c_str(), 1);
    const int err = ::open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    ::dup2(err, STDERR_FILENO);
    ::dup2(::open("/dev/null", O_WRONLY), STDOUT_FILENO);
    ::execv(kProgram, arguments.data());
    ::_exit(127);
  }

  /// "workload on unit" of what the last process acknowledged.
  [[nodiscard]] std::vector<std::string> acknowledged() const {
    const std::string kWord = "stored: ";
    std::vector<std::string> cells;
    for (const auto& line : split(slurp(scratch_.file("log")), '\n')) {
      if (line.starts_with(kWord)) cells.push_back(line.substr(kWord.size()));
    }
    return cells;
  }

  /// What a reader finds; also none where nothing was measured yet.
  [[nodiscard]] std::set<std::string> stored() const {
    const auto csv = pirt({"export", database(), "--format", "csv"});
    std::set<std::string> cells;
    if (csv.exit_code != 0) {
      EXPECT_EQ(csv.exit_code, 2) << csv.err;
      EXPECT_NE(csv.err.find("holds no measurements"), std::string::npos) << csv.err;
      return cells;
    }
    for (const auto& line : split(csv.out, '\n')) {
      const auto fields = split(line, ',');
      if (fields.size() > 3 && fields[0] != "run_id") cells.insert(fields[2] + " on " + fields[3]);
    }
    return cells;
  }

  [[nodiscard]] bool has_unfinished_run() const {
    sqlite3* handle = nullptr;
    EXPECT_EQ(sqlite3_open_v2(database().c_str(), &handle, SQLITE_OPEN_READONLY, nullptr),
              SQLITE_OK);
    sqlite3_stmt* query = nullptr;
    sqlite3_prepare_v2(handle, "SELECT count(*) FROM run WHERE finished IS NULL", -1, &query,
                       nullptr);
    EXPECT_EQ(sqlite3_step(query), SQLITE_ROW);
    const bool found = sqlite3_column_int(query, 0) > 0;
    sqlite3_finalize(query);
    sqlite3_close(handle);
    return found;
  }

  const Scratch scratch_;
};

TEST_F(Kill, LosesNothingThatWasAcknowledgedAndResumes) {
  const auto [first, wanted] = repetitions(3, 500);
  Random random(3 + static_cast<std::uint64_t>(first));
  std::set<std::string> promised;
  int kills = 0;
  int completed = 0;
  const auto check = [&](int status) {
    for (const auto& cell : acknowledged()) promised.insert(cell);
    if (!std::filesystem::exists(database())) {
      EXPECT_THAT(promised, SizeIs(0));
      return;
    }
    const auto found = stored();
    EXPECT_THAT(promised, IsSubsetOf(found)) << "after " << kills << " kills";
    if (WIFSIGNALED(status)) return;
    ASSERT_EQ(WEXITSTATUS(status), 0) << slurp(scratch_.file("log"));
    EXPECT_THAT(found, SizeIs(kCells));
    EXPECT_FALSE(has_unfinished_run());
    EXPECT_FALSE(std::filesystem::exists(database() + "-journal"));
    ++completed;
    std::filesystem::remove(database());
    promised.clear();
  };
  using Clock = std::chrono::steady_clock;
  // How long a run takes that nobody kills, at best: the moments are spread over that.
  Clock::duration whole_run = std::chrono::hours(1);
  const auto run = [&](bool to_be_killed) {
    const bool resume =
        std::filesystem::exists(database()) && (static_cast<void>(stored()), has_unfinished_run());
    const auto begin = Clock::now();
    const pid_t child = start(resume);
    const auto most = static_cast<std::uint64_t>(whole_run.count());
    const auto moment = begin + std::chrono::nanoseconds(to_be_killed ? random.below(most) : 0);
    int status = 0;
    while (::waitpid(child, &status, WNOHANG) == 0) {
      if (to_be_killed && Clock::now() >= moment) {
        ::kill(child, SIGKILL);
        ::waitpid(child, &status, 0);
        break;
      }
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
    if (!resume && !WIFSIGNALED(status)) {
      whole_run = std::min(whole_run, Clock::duration(Clock::now() - begin));
    }
    kills += WIFSIGNALED(status) ? 1 : 0;
    check(status);
    if (to_be_killed && random.below(4) == 0) {
      std::filesystem::remove(database());
      promised.clear();
    }
  };
  run(false);
  while (kills < wanted && !HasFatalFailure()) run(true);
  run(false);
  EXPECT_GE(completed, 2);
  RecordProperty("kills", kills);
  RecordProperty("runs_completed", completed);
}

}  // namespace
}  // namespace pirt::test
