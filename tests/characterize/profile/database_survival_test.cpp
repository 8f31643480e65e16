// What a profile database goes through: kill -9, flipped bits, cut files, full disks, several
// writers. Each test has a seeded subset for every day and the whole of it for tests/run.sh --long.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <cerrno>
#include <set>
#include <sstream>
#include <thread>

#include "characterize/profile/records.h"
#include "characterize/profile/store/reader.h"
#include "characterize/profile/store/writer.h"
#include "tests/characterize/profile/database_support.h"
#include "tests/characterize/support.h"
#include "tests/support/long.h"
#include "workloads/base/math/random.h"

namespace pirt {
namespace {

using test::dump;
using test::error_of;
using test::in_child;
using test::read_bytes;
using test::repeats;
using test::run_sql;
using test::small_cell;
using test::small_run;
using test::TemporaryFolder;
using test::write_bytes;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsSubsetOf;
using ::testing::SizeIs;

/// Cells of different sizes, so that a kill meets short and long transactions.
CellRecord numbered_cell(std::int64_t number) {
  CellRecord cell = small_cell("workload-" + std::to_string(number), "cpu", 1000 + number);
  cell.phases[1].samples = test::ramp(1000 + number, 20 + static_cast<int>(number * 37 % 2000));
  return cell;
}

/// A process that adds run after run of four cells and acknowledges each cell to a pipe after it
/// was stored.
class AcknowledgingWriter {
 public:
  explicit AcknowledgingWriter(const std::filesystem::path& path) {
    if (::pipe(ends_) != 0) throw std::runtime_error("no pipe");
    child_ = ::fork();
    if (child_ == 0) write_for_ever(path);
    ::close(ends_[1]);
  }
  /// Until it has acknowledged a cell, or is gone.
  void wait_for_a_cell() const {
    pollfd acknowledged{ends_[0], POLLIN, 0};
    while (::poll(&acknowledged, 1, -1) < 0 && errno == EINTR) {
    }
  }
  /// Kills it. Returns "RUN CELL" of each cell that it acknowledged.
  std::vector<std::string> kill() {
    ::kill(child_, SIGKILL);
    ::waitpid(child_, nullptr, 0);
    std::string text;
    char buffer[4096];
    for (ssize_t n = 0; (n = ::read(ends_[0], buffer, sizeof buffer)) > 0;) {
      text.append(buffer, static_cast<std::size_t>(n));
    }
    ::close(ends_[0]);
    std::vector<std::string> lines;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
  }

 private:
  [[noreturn]] void write_for_ever(const std::filesystem::path& path) const {
    try {
      ProfileWriter writer(path);
      for (;;) {
        const auto run = writer.begin_run(small_run());
        for (int i = 0; i < 4; ++i) {
          writer.write_cell(run, numbered_cell(run * 4 + i));
          const std::string line = fmt::format("{} {}\n", run, run * 4 + i);
          if (::write(ends_[1], line.data(), line.size()) < 0) ::_exit(3);
        }
        writer.finish_run(run, "2024-01-02T03:05:00Z");
      }
    } catch (const std::exception& error) {
      const std::string line = fmt::format("failed: {}\n", error.what());
      ::_exit(::write(ends_[1], line.data(), line.size()) < 0 ? 5 : 4);
    }
  }

  int ends_[2] = {-1, -1};
  pid_t child_ = -1;
};

/// "RUN CELL" of each cell that is stored with exactly the samples that were written, of runs up to
/// @p newest.
std::set<std::string> stored_cells(const std::filesystem::path& path, std::int64_t newest) {
  std::set<std::string> found;
  for (std::int64_t run = 1; run <= newest; ++run) {
    for (const RowSamples& row : load_samples(path, run)) {
      if (row.phase != Phase::kCall) continue;
      const auto number = std::stoll(row.workload.substr(row.workload.find('-') + 1));
      if (row.samples == numbered_cell(number).phases[1].samples) {
        found.insert(fmt::format("{} {}", run, number));
      }
    }
  }
  return found;
}

TEST(DatabaseSurvival, KeepsEveryAcknowledgedCellWhenItsWriterIsKilled) {
  const TemporaryFolder folder;
  const auto [first, kills] = test::repetitions(8, 500);
  Random random(500 + static_cast<std::uint64_t>(first));
  std::set<std::string> acknowledged;
  std::size_t total = 0;
  for (int i = 0; i < kills; ++i) {
    if (i % 10 == 0) {  // small files are killed in other places than large ones
      std::filesystem::remove(folder / "p.db");
      acknowledged.clear();
    }
    AcknowledgingWriter writer(folder / "p.db");
    if (i % 2 == 1) writer.wait_for_a_cell();  // However slow the machine is.
    std::this_thread::sleep_for(std::chrono::microseconds(random.below(100'000)));
    for (const auto& line : writer.kill()) acknowledged.insert(line);
    if (!std::filesystem::exists(folder / "p.db")) {
      EXPECT_THAT(acknowledged, SizeIs(0));
      continue;
    }
    std::int64_t newest = 0;
    for (const auto& cell : acknowledged) newest = std::max(newest, std::int64_t{std::stoll(cell)});
    EXPECT_THAT(acknowledged, IsSubsetOf(stored_cells(folder / "p.db", newest))) << "kill " << i;
    { ProfileWriter(folder / "p.db").begin_run(small_run()); }
    EXPECT_FALSE(std::filesystem::exists(folder / "p.db-journal")) << "kill " << i;
    total += acknowledged.size();
  }
  EXPECT_GT(total, 0U);
}

/// Two runs on one platform, peaks, and a third run that did not end: something of everything.
void write_full_file(const std::filesystem::path& path) {
  ProfileWriter writer(path);
  for (int i = 0; i < 3; ++i) {
    RunHeader header = small_run();
    header.plan = R"({"cells": ["a", "b"]})";
    const auto run = writer.begin_run(header);
    for (int cell = 0; cell < 4 - i; ++cell) {
      CellRecord record = small_cell("workload-" + std::to_string(cell), "cpu", 1000 * (i + 1));
      record.phases[1].samples = test::ramp(1'000'000 * (i + 1), 200);
      record.phases[1].processes.assign(200, 0);
      std::fill_n(record.phases[1].processes.begin() + 100, 100, 1);
      writer.write_cell(run, record);
    }
    const PeakRecord peak{"gpu", PeakKind::kF32, 1.5e11, "fma", Provenance::kMeasured, {}};
    writer.write_peaks(run, std::vector{peak});
    if (i < 2) writer.finish_run(run, "2024-01-02T03:05:00Z");
  }
}

/// Opens @p damaged for reading everything, and expects an error or what the whole file said.
/// @return Whether it was an error.
bool refused_or_right(const std::filesystem::path& damaged, const std::string& right,
                      const std::string& what) {
  try {
    EXPECT_EQ(dump(damaged), right) << what;
    return false;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput) << what << ": " << error.what();
    EXPECT_THAT(error.what(), HasSubstr(damaged.string())) << what;
    return true;
  }
}

/// Flips single bits of a file. @return How many of them were found out.
int flip_bits(const std::filesystem::path& whole, const std::filesystem::path& damaged, int flips,
              std::uint64_t seed) {
  const std::string bytes = read_bytes(whole);
  const std::string right = dump(whole);
  Random random(seed);
  int refused = 0;
  for (int i = 0; i < flips; ++i) {
    const std::size_t at = random.below(bytes.size());
    const auto bit = static_cast<int>(random.below(8));
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ (1 << bit));
    write_bytes(damaged, changed);
    const bool error = refused_or_right(damaged, right, fmt::format("byte {} bit {}", at, bit));
    refused += error ? 1 : 0;
    EXPECT_EQ(read_bytes(damaged), changed);  // reading repairs nothing and breaks nothing
  }
  return refused;
}

TEST(DatabaseSurvival, GivesAnErrorOrTheRightDataWhateverBitFlips) {
  const TemporaryFolder folder;
  write_full_file(folder / "p.db");
  const auto [first, flips] = test::repetitions(120, 10'000);
  const int refused =
      flip_bits(folder / "p.db", folder / "d.db", flips, 2024 + static_cast<std::uint64_t>(first));
  // The others hit unused space, or what no figure depends on. Observed: 74 of 200.
  EXPECT_GT(refused, flips / 4);
  RecordProperty("flips", flips);
  RecordProperty("refused", refused);
}

TEST(DatabaseSurvival, GivesAnErrorWhereverTheFileIsCutOff) {
  const TemporaryFolder folder;
  write_full_file(folder / "p.db");
  const std::string bytes = read_bytes(folder / "p.db");
  const std::size_t step = 512;
  const auto every = static_cast<std::size_t>(repeats(7, 1));
  for (std::size_t size = 0; size < bytes.size(); size += step * every) {
    write_bytes(folder / "d.db", bytes.substr(0, size));
    error_of(ErrorCode::kBadInput, [&] { return load_profile(folder / "d.db"); });
    error_of(ErrorCode::kBadInput, [&] { ProfileWriter writer(folder / "d.db"); });
    EXPECT_EQ(read_bytes(folder / "d.db").size(), size);
  }
}

TEST(DatabaseSurvival, LosesNoCellOfSeveralWriters) {
  const TemporaryFolder folder;
  constexpr int kWriters = 3;
  const int cells = repeats(8, 100);
  std::vector<pid_t> children;
  for (int w = 0; w < kWriters; ++w) {
    children.push_back(::fork());
    if (children.back() != 0) continue;
    int code = 0;
    try {
      ProfileWriter writer(folder / "p.db");
      const auto run = writer.begin_run(small_run("platform-" + std::to_string(w)));
      for (int i = 0; i < cells; ++i) writer.write_cell(run, numbered_cell(i));
    } catch (const std::exception&) {
      code = 1;
    }
    ::_exit(code);
  }
  for (const pid_t child : children) {
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
  }
  for (int w = 0; w < kWriters; ++w) {
    const auto profile = load_profile(folder / "p.db", "platform-" + std::to_string(w));
    EXPECT_THAT(profile.workloads(), SizeIs(cells));
  }
  EXPECT_THAT(folder.entries(), ElementsAre("p.db"));
}

/// Fills a small file system with cells. @return 0, or the line of what was not as it should be.
int fill_disk(const std::filesystem::path& disk) {
  const auto path = disk / "p.db";
  std::int64_t stored = 0;
  ProfileWriter writer(path);
  const auto run = writer.begin_run(small_run());
  try {
    for (;; ++stored) writer.write_cell(run, numbered_cell(stored));
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kEnvironment) return __LINE__;
    if (std::string(error.what()).find("no space left to write") == std::string::npos) {
      return __LINE__;
    }
  }
  const auto side_files = std::distance(std::filesystem::directory_iterator(disk), {}) - 1;
  if (stored == 0 || side_files != 0) return __LINE__;
  for (std::int64_t i = 0; i < stored; ++i) {
    if (!stored_cells(path, run).contains(fmt::format("{} {}", run, i))) return __LINE__;
  }
  // Small cells may still fit; a second database does not.
  write_bytes(disk / "rest", std::string(1'000'000, 'x'));
  try {
    ProfileWriter(disk / "second.db");
    return __LINE__;
  } catch (const Error& error) {
    if (std::string(error.what()).find("cannot make profile database") == std::string::npos) {
      return __LINE__;
    }
  }
  std::filesystem::remove(disk / "rest");
  if (std::filesystem::exists(disk / "second.db")) return __LINE__;
  return 0;
}

TEST(DatabaseSurvival, KeepsEveryCellOnAFullDisk) {
  const TemporaryFolder folder;
  constexpr int kNotPermitted = 255;
  const int status = in_child([&] {
    // A file system of its own for this process, which is gone with it.
    const bool mounted = ::unshare(CLONE_NEWNS) == 0 &&
                         ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
                         ::mount("none", folder.path().c_str(), "tmpfs", 0, "size=400k") == 0;
    if (!mounted) ::_exit(kNotPermitted);
    try {
      ::_exit(fill_disk(folder.path()) % kNotPermitted);
    } catch (const std::exception& error) {
      fmt::print(stderr, "{}\n", error.what());
      ::_exit(1);
    }
  });
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == kNotPermitted) GTEST_SKIP() << "may not mount a file system here";
  EXPECT_EQ(WEXITSTATUS(status), 0) << "a line of fill_disk";
}

TEST(DatabaseSurvival, SaysThatItCannotRollBackWhereItMayNotWrite) {
  const TemporaryFolder folder;
  test::write_one_run(folder / "p.db");
  test::die_in_transaction(folder / "p.db");
  ::chmod((folder / "p.db").c_str(), 0444);
  ::chmod((folder / "p.db-journal").c_str(), 0444);
  ::chmod(folder.path().c_str(), 0555);
  test::as_nobody([&] {
    EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return load_profile(folder / "p.db"); }),
                HasSubstr("copy both"));
  });
  ::chmod(folder.path().c_str(), 0755);
  EXPECT_THAT(folder.entries(), ElementsAre("p.db", "p.db-journal"));
}

// That of a writer that lives is there for as long as a transaction takes.
TEST(DatabaseSurvival, IsReadBesideAJournalOfAWriterThatLivesByWhoMayNotWrite) {
  const TemporaryFolder folder;
  test::write_one_run(folder / "p.db");
  int ends[2] = {-1, -1};
  ASSERT_EQ(::pipe(ends), 0);
  const pid_t writer = ::fork();
  if (writer == 0) {
    sqlite3* handle = nullptr;
    sqlite3_open((folder / "p.db").c_str(), &handle);
    sqlite3_exec(handle, "BEGIN IMMEDIATE; UPDATE sample SET ns = 0", nullptr, nullptr, nullptr);
    if (::write(ends[1], "x", 1) == 1) ::pause();
    ::_exit(0);
  }
  ::close(ends[1]);
  char begun = 0;
  EXPECT_EQ(::read(ends[0], &begun, 1), 1);
  ::close(ends[0]);
  std::error_code missing;
  EXPECT_GT(std::filesystem::file_size(folder / "p.db-journal", missing), 0U);
  EXPECT_FALSE(missing);
  ::chmod((folder / "p.db").c_str(), 0444);
  ::chmod((folder / "p.db-journal").c_str(), 0444);
  ::chmod(folder.path().c_str(), 0555);
  const int status = in_child([&] {
    // access(), too, asks for the user whom permissions bind.
    constexpr uid_t kNobody = 65534;
    if (::geteuid() == 0 && ::setresuid(kNobody, kNobody, kNobody) != 0) ::_exit(1);
    try {
      ::_exit(load_profile(folder / "p.db").runs.size() == 1 ? 0 : 2);
    } catch (const std::exception& error) {
      fmt::print(stderr, "{}\n", error.what());
      ::_exit(3);
    }
  });
  EXPECT_EQ(status, 0);
  ::chmod(folder.path().c_str(), 0755);
  ::kill(writer, SIGKILL);
  ::waitpid(writer, nullptr, 0);
}

}  // namespace
}  // namespace pirt
