// What a process has from before main: launchers' wishes are kept, libraries' doings undone,
// results alone on stdout.
#include <sched.h>
#include <unistd.h>

#include "tests/cli/program.h"
#include "tests/support/optional_backend.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::HasSubstr;
using testing::Not;

/// The finding of a check of `pirt doctor` under @p launcher.
nlohmann::json finding(const std::string& check, const std::string& launcher) {
  const auto outcome =
      run(launcher + " " + quoted(kProgram) + " doctor --platform fake --seconds 0.05 --json -");
  EXPECT_LE(outcome.exit_code, 1) << outcome.err;
  const auto json = outcome.json();
  for (const auto& each : json.at("findings")) {
    if (each.at("check") == check) return each;
  }
  return {};
}

std::string preloaded() { return std::string("LD_PRELOAD=") + quoted(kMeddlingLibrary); }

class ProcessStart : public testing::Test {
 protected:
  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "skipped: a sanitizer wants to be the first library";
#endif
  }
  const Scratch scratch_;
};

TEST_F(ProcessStart, UndoesWhatALibraryDidAndSaysSo) {
  const auto outcome = run(preloaded() + " " + quoted(kProgram) + " list modes --json -");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.json().at("schema_version"), 1);
  for (const char* part :
       {"hello from a library", "SIGINT, SIGTERM were blocked by a library", "SIGCHLD",
        "took SIGHUP", "changed the process's niceness", "changed the umask", "lowered a limit",
        "changed how numbers are rounded"}) {
    EXPECT_THAT(outcome.err, HasSubstr(part));
  }
  if (::sysconf(_SC_NPROCESSORS_ONLN) > 1) {
    EXPECT_THAT(outcome.err, HasSubstr("bound the process to other cores"));
  }
}

TEST_F(ProcessStart, MeasuresWithSuchALibraryAsWithout) {
  const std::string command =
      " characterize --quick --platform fake --units cpu --filter '^sobel$' -q --db ";
  const auto outcome =
      run(preloaded() + " " + quoted(kProgram) + command + quoted(scratch_.file("p.db")));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, Not(HasSubstr("hello")));
  EXPECT_EQ(outcome.err, "hello from a library\n");  // before main
  const std::string cores = finding("cores", "").at("found");
  EXPECT_EQ(finding("cores", preloaded()).at("found"), cores);
  EXPECT_THAT(std::string(finding("inherited", preloaded()).at("found")),
              AllOf(HasSubstr("LD_PRELOAD="), Not(HasSubstr("nice"))));
}

// The C library gives threads 2 MB where the limit is none.
TEST_F(ProcessStart, GivesThreadsTheUsualStackWhateverTheLimit) {
  for (const char* limit : {"unlimited", "128"}) {
    const auto outcome = run(std::string("ulimit -S -s ") + limit + "; PIRT_TEST_STACK=1 " +
                             preloaded() + " " + quoted(kProgram) + " list modes");
    EXPECT_THAT(outcome.err, AnyOf(HasSubstr("stack of a thread: 8192 kB"),
                                   HasSubstr("ulimit: ")))  // where the hard limit is lower
        << limit;
  }
}

TEST(LaunchersWishes, AreKeptAndSaid) {
  if (::sysconf(_SC_NPROCESSORS_ONLN) > 1) {
    cpu_set_t mine;
    ASSERT_EQ(::sched_getaffinity(0, sizeof mine, &mine), 0);
    int first = 0;
    while (!CPU_ISSET(static_cast<std::size_t>(first), &mine)) ++first;
    EXPECT_THAT(std::string(finding("cores", "taskset -c " + std::to_string(first)).at("found")),
                HasSubstr("1 of "));
  }
  EXPECT_THAT(std::string(finding("inherited", "nice -n 5").at("found")), HasSubstr("nice 5"));
  EXPECT_THAT(std::string(finding("inherited", "OMP_NUM_THREADS=1").at("found")),
              HasSubstr("OMP_NUM_THREADS=1"));
  EXPECT_THAT(std::string(finding("inherited", "OMP_NUM_THREADS=1").at("remedy")),
              AllOf(HasSubstr("unset "), HasSubstr("OMP_NUM_THREADS")));
}

TEST(LaunchersHabits, DoNoHarm) {
  const Scratch scratch;
  const auto measure = [&](const std::string& launcher) {
    return run(launcher + " " + quoted(kProgram) +
               " characterize --quick --platform fake --units cpu --filter '^sobel$' --db " +
               quoted(scratch.file("p.db")));
  };
  for (const char* launcher :
       {"env --ignore-signal=CHLD", "umask 0777;", "ulimit -S -n 16;", "ulimit -S -s 128;",
        "env --block-signal=CHLD --block-signal=PIPE", "exec 9< /dev/null;"}) {
    const auto outcome = measure(launcher);
    EXPECT_EQ(outcome.exit_code, 0) << launcher << outcome.err;
    if (std::string(launcher).ends_with("ignore-signal=CHLD")) {
      EXPECT_THAT(outcome.err, HasSubstr("SIGCHLD were ignored by who started"));
    }
    std::filesystem::permissions(scratch.file("p.db"), std::filesystem::perms::owner_all);
  }
}

TEST(LaunchersHabits, WithoutPathDriversFindTheirTools) {
  PIRT_BACKEND_OR_SKIP("opencl");
  const Scratch scratch;
  const auto outcome = run("env -i HOME=" + quoted(scratch.file("")) + " " + quoted(kProgram) +
                           " sample --workload sobel --unit opencl --platform host --work 1ms");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("PATH is not set"));
}

TEST(LaunchersHabits, BlockedSignalsAreHeard) {
  const Scratch scratch;
  const auto outcome =
      run("env --block-signal=TERM --block-signal=INT " + quoted(kProgram) +
          " characterize --platform fake --max-time 60s --db " + quoted(scratch.file("p.db")) +
          " & p=$!; i=0; while [ ! -s " + quoted(scratch.file("p.db")) +
          " ] && [ $i -lt 500 ]; do sleep 0.02; i=$((i+1)); done; kill -TERM $p; wait $p");
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("SIGINT, SIGTERM were blocked by who started this"),
                                 HasSubstr("--resume")));
}

TEST(Results, AreAloneOnStdout) {
  for (const char* chatter : {"ONEDNN_VERBOSE=1", "OPENCV_LOG_LEVEL=DEBUG"}) {
    const auto outcome = pirt(
        {"sample", "--workload", "fc8", "--unit", "cpu", "--platform", "host-cpu", "--work", "1ms"},
        chatter);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(outcome.json().at("pirt_sample"), 1) << chatter;
  }
}

TEST(Results, OfRunsThatDifferInWhatLibrariesObeyAreNotComparable) {
  const Scratch scratch;
  for (const char* name : {"a.db", "b.db"}) {
    const auto outcome = pirt({"characterize", "--quick", "--platform", "fake", "--units", "cpu",
                               "--filter", "^sobel$", "-q", "--db", scratch.file(name)},
                              std::string(name) == "b.db" ? "ONEDNN_MAX_CPU_ISA=SSE41" : "");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }
  const auto outcome = pirt({"regress", scratch.file("a.db"), scratch.file("b.db")});
  EXPECT_THAT(outcome.out + outcome.err,
              AllOf(HasSubstr("not comparable"), HasSubstr("env.ONEDNN_MAX_CPU_ISA")));
}

}  // namespace
}  // namespace pirt::test
