// What goes wrong with a program under qemu-hexagon: each fault is named, costs one call, and
// leaves no process behind.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <fstream>
#include <thread>

#include "tests/support/paths.h"
#include "tests/workloads/backends/dsp/dsp_support.h"
#include "workloads/backends/dsp/session.h"
#include "workloads/base/error.h"

namespace pirt::dsp {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

/// As in dsp_faults.c.
enum Fault : std::int32_t { kFine, kIllegalInstruction, kNullPointer, kEndless, kEnd };

template <typename Call>
std::string environment_error(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return "";
}

/// A process that is gone, or is only waited for.
bool has_ended(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  std::string number, name, state;
  return !(file >> number >> name >> state) || state == "Z" || state == "X";
}

/// What is heard of an emulator that is @p script.
std::string version_of(const std::string& script) {
  const fs::path emulator = fs::path(testing::TempDir()) / "qemu-hexagon";
  std::ofstream(emulator) << "#!/bin/sh\n" << script << "\n";
  fs::permissions(emulator, fs::perms::owner_all);
  return emulator_version({.emulator = emulator, .plugin = "none", .program = {}, .missing = ""});
}

TEST(DspEmulator, SaysItsVersionWhateverTheLoaderSaysBefore) {
  for (const std::string& noise :
       {std::string("x: libnuma.so.1: no version information available"), std::string(1000, '-')}) {
    EXPECT_EQ(version_of("echo '" + noise + "' >&2; echo 'qemu-hexagon version 7.2.22 (Debian)'"),
              "qemu-hexagon 7.2.22");
  }
}

TEST(DspEmulator, TakesNoPluginAlsoWhereNobodyHearsOfChildren) {
  const auto before = ::signal(SIGCHLD, SIG_IGN);
  const std::string error =
      environment_error([] { version_of("echo \"qemu: unknown option 'plugin'\" >&2; exit 1"); });
  ::signal(SIGCHLD, before);
  EXPECT_THAT(error, HasSubstr("takes no plugin"));
}

class DspSession : public testing::Test {
 protected:
  void SetUp() override {
    if (const auto why = test::why_no_dsp(); !why.empty()) GTEST_SKIP() << why;
    options_ = test::dsp_session_options();
  }
  [[nodiscard]] SessionOptions faulty() const {
    SessionOptions options = options_;
    options.program = options_.program.parent_path() / "pirt_dsp_faults.elf";
    return options;
  }
  static Cost run(ProgramSession& session, Fault fault) {
    const std::array<std::int32_t, 1> values = {fault};
    return session.run(PIRT_DSP_sobel, {}, values, "sobel");
  }
  [[nodiscard]] std::string start_error(const SessionOptions& options) const {
    return environment_error([&] { const ProgramSession session(options); });
  }

  SessionOptions options_;
};

TEST_F(DspSession, NamesTheFileThatIsMissing) {
  SessionOptions options = options_;
  options.emulator = "/nowhere/qemu-hexagon";
  EXPECT_THAT(start_error(options), AllOf(HasSubstr("'/nowhere/qemu-hexagon' is missing"),
                                          HasSubstr("install qemu-user")));
  options = options_;
  options.plugin = "/nowhere/count.so";
  EXPECT_THAT(start_error(options), HasSubstr("'/nowhere/count.so' is missing"));
  options = options_;
  options.program = "/nowhere/dsp.elf";
  EXPECT_THAT(start_error(options), HasSubstr("'/nowhere/dsp.elf' is missing"));
}

TEST_F(DspSession, RefusesAProgramOfAnotherMachine) {
  SessionOptions options = options_;
  options.program = fs::read_symlink("/proc/self/exe");
  EXPECT_THAT(start_error(options), HasSubstr("is for another machine (ELF machine 62, not 164)"));
  options.program = fs::path(test::kSourceFolder) / "README.md";
  EXPECT_THAT(start_error(options), HasSubstr("is no ELF file"));
}

TEST_F(DspSession, SaysWhatAnEmulatorSaidThatDoesNotStart) {
  SessionOptions options = options_;
  options.plugin = options_.program;  // no shared object
  EXPECT_THAT(start_error(options), AllOf(HasSubstr("ended with code"), HasSubstr("plugin")));
  options = options_;
  options.emulator = "/bin/true";
  EXPECT_THAT(start_error(options), HasSubstr("ended with code 0"));
}

TEST_F(DspSession, FindsItsPluginWhateverTheFolderIsCalled) {
  const fs::path folder = fs::path(testing::TempDir()) / "run=7,x";
  fs::create_directories(folder);
  Tools tools = find_tools();
  options_.plugin = folder / "count.so";
  fs::remove(options_.plugin);
  fs::create_symlink(tools.plugin, options_.plugin);
  tools.plugin = options_.plugin;
  EXPECT_THAT(emulator_version(tools), HasSubstr("qemu-hexagon "));
  const ProgramSession session(options_);
  EXPECT_GT(session.process(), 0);
}

TEST_F(DspSession, SaysThatFewerFilesMayBeOpenThanItGivesNumbersTo) {
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit few{203, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &few), 0);
  const std::string error = start_error(options_);
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
  EXPECT_THAT(error, AllOf(HasSubstr("the limit on open files is 203"), HasSubstr("ulimit -n")));
}

// As where whoever uses pirt has no interest in his children.
TEST_F(DspSession, IsOneAlsoWhereNobodyHearsOfChildren) {
  const auto before = ::signal(SIGCHLD, SIG_IGN);
  std::string version, end;
  try {
    version = emulator_version(find_tools());
    ProgramSession session(faulty());
    end = environment_error([&] { run(session, kEnd); });
  } catch (const Error& error) {
    ADD_FAILURE() << error.what();
  }
  ::signal(SIGCHLD, before);
  EXPECT_THAT(version, HasSubstr("qemu-hexagon "));
  EXPECT_THAT(end, HasSubstr("has ended; how is not known"));
}

TEST_F(DspSession, RefusesWhatTheMappingHasNoRoomFor) {
  SessionOptions options = options_;
  options.mapping_bytes = 65536;
  ProgramSession session(options);
  EXPECT_THAT(environment_error([&] { static_cast<void>(session.allocate(1'000'000, "a map")); }),
              AllOf(HasSubstr("a map needs 1000000 bytes"), HasSubstr("of the 65536 bytes")));
  EXPECT_EQ(session.bytes(session.allocate(1000, "a map")).size(), 1000U);
}

TEST_F(DspSession, TheProgramItselfRefusesWhatLiesOutside) {
  ProgramSession session(faulty());
  const std::array buffers = {Buffer{4096, 1000}, Buffer{1U << 26, 1}};
  const std::array<std::int32_t, 1> values = {kFine};
  EXPECT_THAT(environment_error([&] { session.run(PIRT_DSP_sobel, buffers, values, "sobel"); }),
              AllOf(HasSubstr("'sobel': buffer 1 lies outside the 67108864 bytes")));
  EXPECT_GT(run(session, kFine).packets, 0) << "it goes on";
}

TEST_F(DspSession, RefusesAKernelThatTheProgramHasNot) {
  ProgramSession session(options_);
  EXPECT_THAT(environment_error([&] { session.run(PIRT_DSP_KERNEL_COUNT, {}, {}, "x"); }),
              HasSubstr("has no kernel 'x'"));
}

// A row of 1024 bytes in and out: 16 lines each, all new, since each command begins with an empty
// cache; the strips of blur go over them several times.
TEST_F(DspSession, CountsLinesAndMissesWhereMemoryIsModelled) {
  options_.models_memory = true;
  ProgramSession session(options_);
  constexpr std::uint32_t kRows = 8, kColumns = 1024;
  const std::array buffers = {session.allocate(kRows * kColumns, "in"),
                              session.allocate(kRows * kColumns, "out")};
  const std::array<std::int32_t, 3> values = {kColumns, kRows, kColumns};
  const Cost first = session.run(PIRT_DSP_gaussian_blur, buffers, values, "blur");
  const Cost second = session.run(PIRT_DSP_gaussian_blur, buffers, values, "blur");
  constexpr std::int64_t kNeeded = 2 * kRows * kColumns / PIRT_DSP_LINE;
  EXPECT_GE(first.misses, kNeeded);
  EXPECT_LE(first.misses, kNeeded + 32) << "stack, and beyond the edges";
  EXPECT_GT(first.lines, first.misses);
  EXPECT_EQ(second.misses, first.misses);
  EXPECT_EQ(second.lines, first.lines);
  ProgramSession plain(test::dsp_session_options());
  const std::array same = {plain.allocate(kRows * kColumns, "in"),
                           plain.allocate(kRows * kColumns, "out")};
  const Cost counted = plain.run(PIRT_DSP_gaussian_blur, same, values, "blur");
  EXPECT_EQ(counted.packets, first.packets);
  EXPECT_EQ(counted.lines, 0);
}

/// Each costs its call: the error names the kernel, the process is gone, the next call is served by
/// another one, which counts the same.
void costs_one_call(ProgramSession& session, const std::function<void()>& call,
                    const std::function<Cost()>& fine, const std::string& how) {
  const auto packets = fine().packets;
  const pid_t process = session.process();
  EXPECT_THAT(environment_error(call), AllOf(HasSubstr("DSP kernel 'sobel'"), HasSubstr(how)));
  EXPECT_TRUE(has_ended(process));
  EXPECT_LT(session.process(), 0);
  EXPECT_EQ(fine().packets, packets);
  EXPECT_NE(session.process(), process);
}

// qemu does not always find words for an instruction that there is not: some it turns into SIGILL,
// of others its decoder dies.
TEST_F(DspSession, AFaultOfAKernelCostsOneCall) {
  SessionOptions options = faulty();
  options.limit = std::chrono::milliseconds(500);
  ProgramSession session(options);
  for (const auto& [fault, how] : {std::pair(kIllegalInstruction, "crashed (SIG"),
                                   {kNullPointer, "crashed (SIGSEGV)"},
                                   {kEndless, "gave no answer within 0.5 s"},
                                   {kEnd, "ended with code 7"}}) {
    SCOPED_TRACE(how);
    costs_one_call(
        session, [&, f = fault] { run(session, f); }, [&] { return run(session, kFine); }, how);
  }
}

TEST_F(DspSession, WhatIsInTheMappingOutlivesTheProgram) {
  SessionOptions options = faulty();
  ProgramSession session(options);
  const Buffer buffer = session.allocate(100, "a buffer");
  session.bytes(buffer)[99] = std::byte{42};
  static_cast<void>(environment_error([&] { run(session, kNullPointer); }));
  run(session, kFine);
  EXPECT_EQ(session.bytes(buffer)[99], std::byte{42});
}

TEST_F(DspSession, LeavesNoProcessWhenItEnds) {
  pid_t process = -1;
  {
    const ProgramSession session(options_);
    process = session.process();
    EXPECT_FALSE(has_ended(process));
  }
  EXPECT_TRUE(has_ended(process));
}

// As when pirt is killed: nobody closes the session.
TEST_F(DspSession, LeavesNoProcessWhenItsOwnerDies) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  const pid_t owner = ::fork();
  ASSERT_GE(owner, 0);
  if (owner == 0) {
    const ProgramSession session(options_);
    const pid_t process = session.process();
    const bool told = ::write(ends[1], &process, sizeof(process)) == sizeof(process);
    ::_exit(told ? 0 : 1);
  }
  pid_t process = -1;
  ASSERT_EQ(::read(ends[0], &process, sizeof(process)), static_cast<ssize_t>(sizeof(process)));
  ::waitpid(owner, nullptr, 0);
  ::close(ends[0]);
  ::close(ends[1]);
  for (int i = 0; i < 500 && !has_ended(process); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_TRUE(has_ended(process));
}

}  // namespace
}  // namespace pirt::dsp
