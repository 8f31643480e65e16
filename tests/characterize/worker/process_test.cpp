#include "characterize/worker/process.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <thread>
#include <vector>

#include "characterize/machine/system_files.h"
#include "tests/characterize/support.h"
#include "workloads/base/system/file_descriptor.h"

namespace pirt {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

ProcessRequest shell(const std::string& script) {
  ProcessRequest request;
  request.program = "/bin/sh";
  request.arguments = {"-c", script};
  return request;
}

TEST(Process, GivesInputAndTakesOutputAndStatus) {
  auto request = shell("cat; echo complaint >&2; exit 3");
  request.input = std::string(300'000, 'x');  // more than a pipe holds
  const auto result = run_process(request);
  EXPECT_EQ(result.end, ProcessResult::End::kExited);
  EXPECT_EQ(result.code, 3);
  EXPECT_EQ(result.output, request.input);
  EXPECT_EQ(result.diagnostics, "complaint\n");
}

TEST(Process, DoesNotMindAnUnreadInput) {
  auto request = shell("exit 0");
  request.input = std::string(300'000, 'x');
  EXPECT_EQ(run_process(request).code, 0);
}

TEST(Process, ReportsTheSignalThatKilledIt) {
  const auto result = run_process(shell("kill -SEGV $$"));
  EXPECT_EQ(result.end, ProcessResult::End::kSignalled);
  EXPECT_EQ(result.code, SIGSEGV);
}

TEST(Process, KeepsTheEndOfLongDiagnostics) {
  const auto result =
      run_process(shell("i=0; while [ $i -lt 5000 ]; do echo 'a line of chatter' >&2; i=$((i+1)); "
                        "done; echo last >&2"));
  EXPECT_LE(result.diagnostics.size(), 16U * 1024);
  EXPECT_TRUE(result.diagnostics.ends_with("last\n"));
}

TEST(Process, PassesVariablesOnTopOfItsOwn) {
  ::setenv("PIRT_TEST_KEPT", "kept", 1);
  ::setenv("PIRT_TEST_REPLACED", "old", 1);
  auto request = shell("echo $PIRT_TEST_KEPT $PIRT_TEST_REPLACED $PIRT_TEST_ADDED");
  request.environment = {{"PIRT_TEST_REPLACED", "new"}, {"PIRT_TEST_ADDED", "with space"}};
  EXPECT_EQ(run_process(request).output, "kept new with space\n");
}

// Whoever waits for the end of a pipe that this process has from its launcher would wait for it
// too.
TEST(Process, HandsDownNoDescriptors) {
  const int inherited =
      ::open("/dev/null", O_RDONLY);  // without O_CLOEXEC, as a launcher leaves it
  EXPECT_EQ(
      run_process(shell("[ -e /proc/self/fd/" + std::to_string(inherited) + " ]; echo $?")).output,
      "1\n");
  ::close(inherited);
}

TEST(Process, NamesTheLimitOnProcessorTime) {
  const auto result = run_process(shell("kill -XCPU $$"));
  EXPECT_THAT(how_it_ended(result, {}), HasSubstr("ulimit -t"));
}

/// Whether the process is gone or only waits to be reaped by init.
bool is_gone(pid_t pid) {
  std::ifstream in("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  return !std::getline(in, text) || text.find(") Z") != std::string::npos;
}

bool is_gone_soon(pid_t pid) {
  for (int i = 0; i < 500 && !is_gone(pid); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return is_gone(pid);
}

TEST(Process, KillsItAndWhatItStartedWhenTheTimeIsOver) {
  auto request = shell("sleep 1000 & echo $!; sleep 1000");
  request.limit = std::chrono::milliseconds(300);
  const auto result = run_process(request);
  EXPECT_EQ(result.end, ProcessResult::End::kTimedOut);
  ASSERT_FALSE(result.output.empty());
  EXPECT_TRUE(is_gone_soon(std::stoi(result.output)));
}

TEST(Process, IsKilledWhenItPrintsTooMuch) {
  auto request = shell("exec yes");
  request.most_output = 3 << 20;
  const auto result = run_process(request);
  EXPECT_EQ(result.end, ProcessResult::End::kTooMuch);
  EXPECT_THAT(how_it_ended(result, {}), HasSubstr("more than 3 MiB"));
}

TEST(Process, DoesNotWaitForWhatItLeftBehind) {
  // The sleeper holds the pipes open; it is killed with the group.
  const auto result = run_process(shell("sleep 1000 & echo $!"));
  EXPECT_EQ(result.end, ProcessResult::End::kExited);
  ASSERT_FALSE(result.output.empty());
  EXPECT_TRUE(is_gone_soon(std::stoi(result.output)));
}

TEST(Process, ACodeOf127IsTheProgramsOwn) {
  const auto missing = run_process(shell("no-such-program-anywhere"));
  EXPECT_EQ(missing.end, ProcessResult::End::kExited);
  EXPECT_EQ(missing.code, 127);
}

TEST(Process, TellsWhatItTook) {
  const auto slept = run_process(shell("sleep 0.05"));
  EXPECT_GE(slept.wall, std::chrono::milliseconds(50));
  EXPECT_LT(slept.cpu, slept.wall);
  const auto busy = run_process(shell("i=0; while [ $i -lt 20000 ]; do i=$((i + 1)); done"));
  EXPECT_GT(busy.cpu, Nanos(0));
  // A child of a child counts once it was waited for. So much is more than this process has.
  const std::int64_t bytes =
      2 * 1024 * number_of("/proc/self/status", "VmRSS", ':').value() + 100'000'000;
  const auto large =
      run_process(shell("head -c " + std::to_string(bytes) + " /dev/zero | tail -c " +
                        std::to_string(bytes - 1) + " | wc -c"));
  EXPECT_GT(large.peak_bytes, bytes * 9 / 10) << large.diagnostics;
  EXPECT_LT(run_process(shell("true")).peak_bytes, bytes * 9 / 10);
}

// The kernel counts the forked copy of this process, too.
TEST(Process, SaysWhatItsPeakMayBeThatOfThisProcess) {
  std::vector<char> held(64U << 20, 'x');
  volatile char* const kept = held.data();  // so that it is not left out
  kept[0] = 'y';
  const auto small = run_process(shell("true"));
  EXPECT_GE(small.inherited_bytes, std::ssize(held));
  EXPECT_LE(10 * small.peak_bytes, 11 * small.inherited_bytes);
}

// fork does not copy the pages of a file that nobody wrote, as a program's code and libraries.
TEST(Process, DoesNotTakeWhatThisProcessReadOfFilesForItsPeak) {
  constexpr std::size_t kBytes = 64U << 20, kPage = 4096;
  const auto before = run_process(shell("true"));
  const FileDescriptor file(::memfd_create("pirt-test", MFD_CLOEXEC));
  ASSERT_EQ(::ftruncate(file.get(), kBytes), 0);
  void* const mapped = ::mmap(nullptr, kBytes, PROT_READ, MAP_PRIVATE, file.get(), 0);
  ASSERT_NE(mapped, MAP_FAILED);
  const auto* const bytes = static_cast<const volatile char*>(mapped);
  for (std::size_t at = 0; at < kBytes; at += kPage) static_cast<void>(bytes[at]);
  ASSERT_GT(number_of("/proc/self/status", "VmRSS", ':').value() * 1024, std::int64_t{kBytes});
  const auto after = run_process(shell("true"));
  EXPECT_GT(after.inherited_bytes, 0);
  EXPECT_LT(after.inherited_bytes - before.inherited_bytes, std::int64_t{kBytes / 2});
  EXPECT_LT(after.peak_bytes - before.peak_bytes, std::int64_t{kBytes / 2});
  ::munmap(mapped, kBytes);
}

TEST(Process, StopsWhenAsked) {
  std::atomic<bool> stop = false;
  auto request = shell("sleep 1000");
  request.stop = &stop;
  std::thread later([&stop] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    stop = true;
  });
  EXPECT_EQ(run_process(request).end, ProcessResult::End::kStopped);
  later.join();
}

TEST(Process, LeavesNoZombiesAndNoOpenFiles) {
  const auto open_files = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
  };
  static_cast<void>(run_process(shell("true")));
  const auto before = open_files();
  for (int i = 0; i < 20; ++i) static_cast<void>(run_process(shell("true")));
  EXPECT_EQ(open_files(), before);
  EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1);  // ECHILD: no child is left to be reaped
}

TEST(Process, SaysThatAProgramCannotBeStarted) {
  ProcessRequest request;
  request.program = "/no/such/program";
  EXPECT_THAT(test::error_of(ErrorCode::kEnvironment, [&] { return run_process(request); }),
              StartsWith("cannot start '/no/such/program': No such file or directory"));
}

}  // namespace
}  // namespace pirt
