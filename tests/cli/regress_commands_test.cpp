// pirt regress with two commands: each way to read them, each way to end, through the program.
#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class RegressCommands : public testing::Test {
 protected:
  /// @param body  $n is how many processes there were before.
  std::string script(const std::string& name, const std::string& body) const {
    const auto count = scratch_.file(name + ".count");
    const auto path = scratch_.write(name, "#!/bin/sh\nn=$(cat '" + count +
                                               "' 2>/dev/null || echo 0); echo $((n + 1)) > '" +
                                               count + "'\n" + body + "\n");
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
    return path;
  }
  [[nodiscard]] int processes(const std::string& name) const {
    return std::atoi(slurp(scratch_.file(name + ".count")).c_str());
  }
  Outcome compare(const std::string& base, const std::string& candidate, const std::string& reads,
                  std::vector<std::string> more = {}) const {
    std::filesystem::remove(scratch_.file("ledger"));
    return go_on(base, candidate, reads, std::move(more));
  }
  Outcome go_on(const std::string& base, const std::string& candidate, const std::string& reads,
                std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {"regress",
                                          "--baseline-command",
                                          base,
                                          "--candidate-command",
                                          candidate,
                                          "--reads",
                                          reads,
                                          "--ledger",
                                          scratch_.file("ledger")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return pirt(arguments);
  }

  Scratch scratch_;
};

TEST_F(RegressCommands, LinesOfAnyProgramAreJudgedInTheirDirection) {
  const auto same = compare("echo time 1 s", "echo time 1 s", "lines", {"--all"});
  EXPECT_EQ(same.exit_code, 0) << same.err;
  EXPECT_THAT(same.out, AllOf(HasSubstr("no regression"), HasSubstr("time")));
  EXPECT_THAT(same.err, AllOf(HasSubstr("12 blocks of 4 runs of"), HasSubstr("confirming"),
                              HasSubstr("at most --max-time")));
  const auto slow = compare("printf 'rate 100 MB/s higher\\nsize 10 kB\\n'",
                            "printf 'rate 90 MB/s higher\\nsize 10 kB\\n'", "lines", {"--all"});
  EXPECT_EQ(slow.exit_code, 1) << slow.err;
  EXPECT_THAT(slow.out,
              AllOf(HasSubstr("1 slower, 1 same"), HasSubstr("MB/s"), HasSubstr("-10.0")));
  EXPECT_EQ(compare("echo rate 90 x higher", "echo rate 100 x higher", "lines").exit_code, 0);
}

TEST_F(RegressCommands, NamesThatOnlyOneHasAreSaidAndNotJudged) {
  const auto outcome = compare("printf 'a 1 s\\nold 1 s\\nnone 0 s\\n'",
                               "printf 'a 1 s\\nnew 9 s\\nnone 0 s\\n'", "lines", {"--all"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("only the baseline has it"), HasSubstr("only the candidate has it"),
                    HasSubstr("there is no ratio"), HasSubstr("3 not judged")));
  EXPECT_THAT(compare("printf 'a 1 s\\nold 1 s\\n'", "echo a 1 s", "lines").out,
              HasSubstr("Not judged: old (only the baseline has it)."));
  const auto fell = compare("printf 'a 1 s\\nrate 100 x higher\\n'",
                            "printf 'a 1 s\\nrate 0 x higher\\n'", "lines");
  EXPECT_EQ(fell.exit_code, 3) << fell.err;
  EXPECT_THAT(fell.out, AllOf(HasSubstr("rate"), HasSubstr("it fell to 0")));
  const auto rose =
      compare("printf 'a 1 s\\ndrops 0 x\\n'", "printf 'a 1 s\\ndrops 5 x\\n'", "lines");
  EXPECT_EQ(rose.exit_code, 3) << rose.err;
  EXPECT_THAT(rose.out, AllOf(HasSubstr("drops"), HasSubstr("it rose from 0")));
  const auto nothing = compare("echo a 1 s", "echo b 1 s", "lines");
  EXPECT_EQ(nothing.exit_code, 3) << "no figure in common";
}

TEST_F(RegressCommands, AProcessIsTimedWhateverItPrints) {
  // Sleeping takes wall time alone, for which a machine cannot be too busy.
  const auto slow = compare("sleep 0.02", "sleep 0.05", "time", {"--all", "--max-time", "2min"});
  EXPECT_EQ(slow.exit_code, 1) << slow.out << slow.err;
  EXPECT_THAT(slow.out, AllOf(HasSubstr("wall"), HasSubstr("cpu")));
}

TEST_F(RegressCommands, GoogleBenchmarksAreAskedForAsLongAsTheyAreUndecided) {
  // Says what it was asked for, as the real one does.
  const std::string body =
      "echo \"$@\" >> '" + scratch_.file("asked") +
      "'\ncase \"$*\" in *benchmark_format=json*) ;; *) exit 1;; esac\n"
      "sort='{\"name\": \"sort/8\", \"run_type\": \"iteration\", \"real_time\": SORT, "
      "\"time_unit\": \"ns\"}'\n"
      "hash='{\"name\": \"hash\", \"run_type\": \"iteration\", \"real_time\": 10, \"time_unit\": "
      "\"ns\"}'\n"
      "case \"$*\" in *filter=*hash*|*json) sort=\"$sort, $hash\";; esac\n"
      "echo '{\"benchmarks\": ['$sort']}'";
  const auto bench = [&](const std::string& name, const std::string& ns) {
    std::string text = body;
    return script(name, text.replace(text.find("SORT"), 4, ns));
  };
  const auto slow = compare(bench("old", "100"), bench("new", "110"), "gbench", {"--all"});
  EXPECT_EQ(slow.exit_code, 1) << slow.out << slow.err;
  EXPECT_THAT(slow.out, AllOf(HasSubstr("1 slower, 1 same"), HasSubstr("sort/8")));
  EXPECT_THAT(slurp(scratch_.file("asked")), HasSubstr("--benchmark_filter=^(sort/8)$"));
}

TEST_F(RegressCommands, WhatPirtItselfIsMeasuredByIsAReader) {
  const std::string sample = quoted(kProgram) +
                             " sample --workload sobel --unit cpu --platform "
                             "fake --work 1ms";
  const auto outcome = compare(sample, sample, "pirt", {"--all"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("execute"));
}

TEST_F(RegressCommands, AProgramThatFailsIsNotFast) {
  const std::string good = "echo time 1 s";
  const auto failed = compare(good, script("bad", "echo no luck >&2; exit 7"), "lines");
  EXPECT_EQ(failed.exit_code, 1);
  EXPECT_THAT(failed.out, AllOf(HasSubstr("the candidate failed: ended with code 7: no luck")));
  EXPECT_THAT(compare(script("lost", "exit 7"), good, "lines").out,
              HasSubstr("the baseline failed"));
  EXPECT_EQ(compare(script("lost2", "exit 7"), good, "lines").exit_code, 3);
  const auto later =
      compare(good, script("later", "[ $n -lt 9 ] || kill -SEGV $$\necho time 1 s"), "lines");
  EXPECT_EQ(later.exit_code, 1);
  EXPECT_THAT(later.out, AllOf(HasSubstr("SIGSEGV"), HasSubstr("4 blocks measured before")));
  const auto hung = compare(good, "sleep 60", "lines", {"--sample-limit", "300ms"});
  EXPECT_EQ(hung.exit_code, 1);
  EXPECT_THAT(hung.out, HasSubstr("timed out after 0.3 s"));
  const auto within = compare(good, "sleep 60", "lines", {"--max-time", "3s"});
  EXPECT_EQ(within.exit_code, 1) << "the limit of a process is longer than the whole time";
  EXPECT_THAT(within.out, HasSubstr("timed out after 1 s"));
  const auto endless = compare(good, "yes", "lines");
  EXPECT_EQ(endless.exit_code, 1);
  EXPECT_THAT(endless.out, HasSubstr("printed more than 64 MiB"));
  const auto odd = compare(good, "echo time one s", "lines");
  EXPECT_EQ(odd.exit_code, 1);
  EXPECT_THAT(odd.out, HasSubstr("'one' is no number"));
  const auto error =
      compare(script("right", "echo '{\"benchmarks\": [{\"name\": \"b\", \"real_time\": 1}]}'"),
              script("wrong",
                     "echo '{\"benchmarks\": [{\"name\": \"b\", \"error_occurred\": true, "
                     "\"error_message\": \"no file\"}]}'"),
              "gbench");
  EXPECT_EQ(error.exit_code, 1);
  EXPECT_THAT(error.out, HasSubstr("benchmark b: no file"));
}

TEST_F(RegressCommands, SetsUpOnceAndWarmsUp) {
  const auto set_up = script("setup", "exit 0");
  const auto base = script("base", "echo time 1 s");
  EXPECT_EQ(compare(base, "echo time 1 s", "lines", {"--setup-command", set_up, "--warm-up", "3"})
                .exit_code,
            0);
  EXPECT_EQ(processes("setup"), 1);
  EXPECT_EQ(processes("base"), 3 + 2 * 8) << "eight blocks clear it";
  const auto slow_set_up = compare("echo time 1 s", "echo time 1 s", "lines",
                                   {"--setup-command", "sleep 0.5", "--sample-limit", "400ms"});
  EXPECT_EQ(slow_set_up.exit_code, 0) << slow_set_up.err;
  const auto broken = script("broken", "echo no disk >&2; exit 3");
  const auto outcome = compare(base, base, "lines", {"--setup-command", broken});
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("setup command"), HasSubstr("no disk")));
}

TEST_F(RegressCommands, TakesNoMoreThanItsTimeAndGoesOn) {
  const auto outcome = compare("sh -c 'sleep 0.05; echo a 1 s'", "sh -c 'sleep 0.05; echo a 1.2 s'",
                               "lines", {"--max-time", "1s"});
  EXPECT_EQ(outcome.exit_code, 3) << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("same command goes on"));
  const auto decided =
      go_on("sh -c 'sleep 0.05; echo a 1 s'", "sh -c 'sleep 0.05; echo a 1.2 s'", "lines");
  EXPECT_EQ(decided.exit_code, 1) << decided.out;
  EXPECT_THAT(decided.err, HasSubstr("going on with"));
}

TEST_F(RegressCommands, ALedgerIsOfWhatWasRun) {
  const auto base = script("base", "echo a 1 s");
  ASSERT_EQ(compare(base, base, "lines").exit_code, 0);
  script("base", "echo a 2 s");
  expect_refused(go_on(base, base, "lines"), {"ledger", "another comparison", "baseline"});
  const auto named = script("named", "exec cat " + scratch_.write("figures", "a 1 s\n"));
  const std::string command = named + " " + scratch_.file("figures");
  ASSERT_EQ(compare(command, command, "lines").exit_code, 0);
  scratch_.write("figures", "a 5 s\n");
  expect_refused(go_on(command, command, "lines"), {"another comparison"});
}

TEST_F(RegressCommands, ALedgerIsOfWhatScriptsAndWrappersRun) {
  std::filesystem::create_directory(scratch_.file("build"));
  std::filesystem::create_symlink(script("build/bench", "echo a 1 s"), scratch_.file("link"));
  scratch_.write("build/libbench.so", "1");
  const auto folder = std::filesystem::path(script("inner", "echo a 1 s")).parent_path().string();
  const std::string base = "sh -c 'cd " + folder + " && ./inner 2>/dev/null'";
  const std::string candidate = "env " + scratch_.file("link");
  ASSERT_EQ(compare(base, candidate, "lines").exit_code, 0);
  EXPECT_EQ(go_on(base, candidate, "lines").exit_code, 0);
  scratch_.write("build/libbench.so", "2");
  expect_refused(go_on(base, candidate, "lines"), {"another comparison", "candidate", "link"});
  scratch_.write("build/libbench.so", "1");
  script("inner", "echo a 2 s");
  expect_refused(go_on(base, candidate, "lines"), {"another comparison", "baseline", "inner"});
}

TEST_F(RegressCommands, WhatACommandWritesIsNotWhatItIs) {
  const auto output = scratch_.file("o.json");
  const std::string command =
      script("bench", "echo $n > '" + output + "'; echo a 1 s") + " --benchmark_out=" + output;
  ASSERT_EQ(compare(command, command, "lines").exit_code, 0);
  const auto again = go_on(command, command, "lines");
  EXPECT_EQ(again.exit_code, 0) << again.err;
}

TEST_F(RegressCommands, RefusesBadInput) {
  expect_refused(compare("a | b", "b", "lines"), {"has |", "sh -c"});
  expect_refused(compare("no-such-program", "echo", "lines"), {"no-such-program"});
  expect_refused(compare("echo 'a", "echo", "lines"), {"quote"});
  EXPECT_EQ(compare("echo", "echo", "gbnch").exit_code, 2);
  expect_refused(pirt({"regress", "--baseline-command", "echo"}), {"--candidate-command"});
  expect_refused(compare("echo", "echo", "lines", {"a.db", "b.db"}), {"profiles"});
  expect_refused(compare("echo", "echo", "lines", {"--units", "cpu"}), {"--units"});
  expect_refused(compare("echo", "echo", "lines", {"--filter", "x"}), {"--filter"});
  expect_refused(compare("echo", "echo", "lines", {"--warm-up", "0"}), {"0", "1 and 100"});
  expect_refused(pirt({"regress", "a.db", "b.db", "--reads", "lines"}), {"--baseline-command"});
}

}  // namespace
}  // namespace pirt::test
