// pirt regress with two programs: scripts in place of programs for each way to end, and the real
// one against itself.
#include <csignal>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// Scripts that answer as `pirt sample` does, and run the real program for all else.
class RegressPrograms : public testing::Test {
 protected:
  /// @param body  Runs for each sample; $n is how many samples there were before, $verify is empty
  ///              unless it is a first one.
  std::string program(const std::string& name, const std::string& body) const {
    const auto count = scratch_.file(name + ".count");
    const auto path = scratch_.write(
        name,
        "#!/bin/sh\ncase \"$*\" in *--help*) echo --workload; exit 0;; esac\n"
        "verify=; case \"$*\" in *--verify*) verify=1;; esac\n"
        "n=$(cat '" +
            count + "' 2>/dev/null || echo 0); echo $((n + 1)) > '" + count + "'\n" + body + "\n");
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
    return path;
  }
  static std::string answers(const std::string& call_s, const std::string& more = "") {
    return R"(echo '{"pirt_sample": 1, "version": "1", "device": "CPU", "inputs": "a", )"
           R"("right": true, "detail": "", )" +
           more + R"("seconds": {"call": )" + call_s + "}}'";
  }
  Outcome compare(const std::string& base, const std::string& candidate,
                  std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {
        "regress", "--baseline-program", base,    "--candidate-program", candidate, "--filter",
        "sobel",   "--ledger",           ledger()};
    if (std::ranges::find(more, "--platform") == more.end()) {
      arguments.insert(arguments.end(), {"--platform", "fake", "--units", "cpu"});
    }
    arguments.insert(arguments.end(), more.begin(), more.end());
    return pirt(arguments);
  }
  [[nodiscard]] std::string ledger() const { return scratch_.file("ledger"); }
  void forget() const { std::filesystem::remove(ledger()); }

  Scratch scratch_;
};

TEST_F(RegressPrograms, PassesEqualAndFailsSlowerOnes) {
  const auto base = program("base", answers("0.010"));
  const auto same = compare(base, program("same", answers("0.010")), {"--all"});
  EXPECT_EQ(same.exit_code, 0) << same.err;
  EXPECT_THAT(same.out, AllOf(HasSubstr("no regression"), HasSubstr("sobel")));
  forget();
  const auto junit = scratch_.file("r.xml");
  const auto slow =
      compare(base, program("slow", answers("0.012")), {"--markdown", "-", "--junit", junit});
  EXPECT_EQ(slow.exit_code, 1) << slow.err;
  EXPECT_THAT(slow.out, AllOf(HasSubstr("REGRESSION"), HasSubstr("| sobel"), HasSubstr("+20.0")));
  EXPECT_THAT(slurp(junit), HasSubstr("<failure"));
}

TEST_F(RegressPrograms, KeepsWhatWasMeasuredBeforeACrashAndSaysSo) {
  const auto base = program("base", answers("0.010"));
  const auto crash = program("crash", "[ $n -lt 9 ] || kill -SEGV $$\n" + answers("0.010"));
  const auto outcome = compare(base, crash);
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("SIGSEGV"), HasSubstr("4 blocks measured before")));
  forget();
  const auto hang = program("hang", "[ $n -lt 3 ] || exec tail -f /dev/null\n" + answers("0.010"));
  const auto hung = compare(base, hang, {"--sample-limit", "500ms"});
  EXPECT_EQ(hung.exit_code, 1) << hung.err;
  EXPECT_THAT(hung.out, HasSubstr("timed out after 0.5 s"));
  forget();
  const auto babble = compare(base, program("babble", "echo hello"));
  EXPECT_EQ(babble.exit_code, 1);
  EXPECT_THAT(babble.out, HasSubstr("no answer of 'pirt sample'"));
  forget();
  const auto lost = compare(program("lost", "exit 4"), base);
  EXPECT_EQ(lost.exit_code, 3);
  EXPECT_THAT(lost.out, HasSubstr("the baseline failed"));
}

TEST_F(RegressPrograms, WrongOutputFails) {
  const auto base = program("base", answers("0.010"));
  const auto wrong = program("wrong", answers("0.010") + " | sed s/true/false/");
  const auto outcome = compare(base, wrong);
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out, HasSubstr("wrong output"));
}

TEST_F(RegressPrograms, GoesOnAfterAnInterruption) {
  const auto base = program("base", answers("0.010"));
  // The parent is the comparing pirt.
  const auto stop = program("stop", "[ $n -ne 9 ] || kill -INT $PPID\n" + answers("0.012"));
  const auto first = compare(base, stop);
  EXPECT_EQ(first.exit_code, 4);
  EXPECT_THAT(first.err, AllOf(HasSubstr("interrupted; 0 of 1"), HasSubstr("same command")));
  EXPECT_THAT(first.out, HasSubstr("INCONCLUSIVE"));
  const auto second = compare(base, stop);
  EXPECT_EQ(second.exit_code, 1) << second.err;
  EXPECT_THAT(second.err, HasSubstr("going on with"));
  EXPECT_THAT(second.out, HasSubstr("+20.0"));
  // Decided: nothing is left to measure.
  const auto count = slurp(scratch_.file("stop.count"));
  EXPECT_EQ(compare(base, stop).exit_code, 1);
  EXPECT_EQ(slurp(scratch_.file("stop.count")), count);
  // Another candidate is another comparison.
  expect_refused(compare(base, base), {"ledger", "another comparison", "candidate"});
}

// An edited platform file is another comparison: 1.6 and 16 ms stood in one ledger.
TEST_F(RegressPrograms, ALedgerIsOfThePlatformsTextAndOfLibrariesBesideTheProgram) {
  const auto base = program("base", answers("0.010"));
  const auto on = [&](const std::string& text) {
    return compare(base, base,
                   {"--platform", scratch_.write("board.yaml", text), "--units", "cpu"});
  };
  const std::string board = "platform: board\nunits: {cpu: {backend: fake}}\n";
  ASSERT_EQ(on(board).exit_code, 0);
  expect_refused(on("platform: board\nunits: {cpu: {backend: fake, slots: 2}}\n"),
                 {"another comparison", "platform_text"});
  EXPECT_EQ(on(board).exit_code, 0);
  scratch_.write("library.so", "1");
  expect_refused(on(board), {"another comparison", "baseline", "library.so"});
}

TEST_F(RegressPrograms, TimeThatIsUpIsInconclusive) {
  const auto base = program("base", answers("0.010"));
  const auto outcome = compare(base, base, {"--max-time", "1ms"});
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("same command goes on"));
}

TEST_F(RegressPrograms, UnitsOfTheirOwnCoresAreMeasuredSideBySideUnlessForbidden) {
  const auto platform = scratch_.write(
      "two.yaml",
      "platform: two\nunits: {a: {backend: cpu, cores: [0]}, b: {backend: cpu, cores: [1]}}\n");
  // Of each unit one at a time, in either case; --one-at-a-time: one at all.
  const std::string exclusive = "mkdir '" + scratch_.file("busy") +
                                R"('$1 || { echo two at once >&2; exit 5; }; sleep 0.01; rmdir ')" +
                                scratch_.file("busy") + "'$1\n" + answers("0.010");
  const std::string by_unit =
      "while [ $# -gt 1 ]; do [ $1 != --unit ] || { set -- $2; break; }; shift; done\n";
  const auto run = [&](const std::string& name, const std::string& body,
                       std::vector<std::string> more) {
    const auto tested = program(name, body + exclusive);
    more.insert(more.end(), {"--all", "--platform", platform, "--units", "a,b"});
    forget();
    return compare(tested, tested, more);
  };
  const auto side_by_side = run("lanes", by_unit, {});
  EXPECT_EQ(side_by_side.exit_code, 0) << side_by_side.out;
  const auto alone = run("alone", "set --\n", {"--one-at-a-time"});
  EXPECT_EQ(alone.exit_code, 0) << alone.out;
}

TEST_F(RegressPrograms, RefusesBadInput) {
  const auto base = program("base", answers("0.010"));
  expect_refused(compare(base, scratch_.file("none")), {"--candidate-program", "none"});
  expect_refused(compare(base, scratch_.write("text", "no program")), {"text"});
  expect_refused(compare(base, "/bin/true"), {"/bin/true", "pirt sample"});
  expect_refused(compare(base, base, {"a.db", "b.db"}), {"profiles", "--baseline-program"});
  expect_refused(compare(base, base, {"--work", "-1s"}), {"-1s"});
  expect_refused(pirt({"regress", "--baseline-program", base, "--candidate-program", base,
                       "--filter", "scheduler", "--ledger", "/nonexistent/l"}),
                 {"/nonexistent/l"});
  // The scheduler alone, also as an expression, is on no unit.
  const auto scheduler = [&base](const std::string& filter, std::vector<std::string> more) {
    std::vector<std::string> words = {"regress", "--baseline-program", base,  "--candidate-program",
                                      base,      "--filter",           filter};
    words.insert(words.end(), more.begin(), more.end());
    return pirt(words);
  };
  expect_refused(scheduler("^scheduler$", {"--ledger", "/nonexistent/l"}), {"/nonexistent/l"});
  for (const char* filter : {"scheduler", "^scheduler$"}) {
    expect_refused(scheduler(filter, {"--units", "cpu"}), {"scheduler", "--units"});
  }
  expect_refused(pirt({"regress", "--baseline-program", base}), {"--candidate-program"});
  expect_refused(pirt({"regress", "--self-test"}), {"build/tests/bench/self_test"});
  // What would mean nothing.
  expect_refused(compare(base, base, {"--mix", "full-robot"}), {"--mix", "profiles"});
  expect_refused(pirt({"regress", "a.db", "b.db", "--cold"}), {"profiles", "--cold"});
}

TEST_F(RegressPrograms, ComparesItselfOnASimulatedUnit) {
  const auto outcome = compare(kProgram, kProgram, {"--work", "5ms", "--all"});
  // Set-up of a simulated device takes no time, so that only what it simulates is compared.
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("execute"));
}

TEST(SampleCommand, TimesPhasesAndShowsInjectedWork) {
  const auto plain =
      pirt({"sample", "--workload", "sobel", "--unit", "cpu", "--work", "20ms", "--verify"});
  ASSERT_EQ(plain.exit_code, 0) << plain.err;
  EXPECT_EQ(plain.json()["right"], true);
  // The least of three each, in turns: a neighbour may be busy for as long as a process takes.
  double before = plain.json()["seconds"]["execute"];
  double slowed = 1e9;
  for (int i = 0; i < 3; ++i) {
    const auto least = [](double& least_s, std::vector<std::string> extra) {
      std::vector<std::string> command = {"sample", "--workload", "sobel", "--unit",
                                          "cpu",    "--work",     "20ms"};
      command.insert(command.end(), extra.begin(), extra.end());
      least_s = std::min(least_s, pirt(command).json()["seconds"]["execute"].get<double>());
    };
    least(before, {});
    least(slowed, {"--inject", "execute=20"});
  }
  EXPECT_GT(slowed, 2 * before);
  const auto setup = pirt({"sample", "--workload", "sobel", "--unit", "cpu", "--setup"});
  ASSERT_EQ(setup.exit_code, 0) << setup.err;
  EXPECT_TRUE(setup.json()["seconds"].contains("prepare"));
  EXPECT_FALSE(setup.json()["seconds"].contains("call"));
  const auto scheduler = pirt({"sample", "--workload", "scheduler", "--work", "20ms"});
  EXPECT_EQ(scheduler.json()["seconds"].size(), 4U);
  expect_refused(pirt({"sample", "--workload", "soebl", "--unit", "cpu"}), {"soebl", "sobel"});
  expect_refused(pirt({"sample", "--workload", "sobel"}), {"--unit"});
  expect_refused(pirt({"sample", "--workload", "sobel", "--unit", "cpu", "--inject", "x"}), {"x"});
}

}  // namespace
}  // namespace pirt::test
