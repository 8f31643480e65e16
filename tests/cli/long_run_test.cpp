// pirt characterize as a process: signals, scratch, standard streams, two at once.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class LongRun : public testing::Test {
 protected:
  LongRun() { std::filesystem::create_directory(tmp()); }

  [[nodiscard]] std::string tmp() const { return scratch_.file("tmp"); }
  [[nodiscard]] std::string database() const { return scratch_.file("p.db"); }

  /// The command of a run of two workloads on one unit, which takes a few seconds.
  /// @param signals  An option of env: a shell's background ignores SIGINT.
  [[nodiscard]] std::string command(const std::string& options = "",
                                    const std::string& signals = "--default-signal") const {
    return "exec env " + signals + " TMPDIR=" + quoted(tmp()) + " " + quoted(kProgram) +
           " characterize --quick --platform fake --units cpu --filter '^(pool5|fc8)$' --db " +
           quoted(database()) + " " + options;
  }

  /// Lines that start @p command and, once it has its scratch folder, send it @p signal.
  [[nodiscard]] std::string with_signal(const std::string& command,
                                        const std::string& signal) const {
    return "(" + command + ") & pid=$!; while [ -z \"$(ls " + quoted(tmp()) +
           ")\" ]; do sleep 0.01; done; kill -" + signal + " $pid; wait $pid";
  }

  [[nodiscard]] std::vector<std::string> left() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(tmp())) {
      names.push_back(entry.path().filename());
    }
    return names;
  }

  const Scratch scratch_;
};

TEST_F(LongRun, CleansUpAtEverySignalThatEndsIt) {
  for (const auto* signal : {"INT", "TERM", "HUP", "PIPE"}) {
    const auto outcome = run(with_signal(command(), signal));
    EXPECT_EQ(outcome.exit_code, 4) << signal << outcome.err;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("interrupted"), HasSubstr("--resume"))) << signal;
    EXPECT_THAT(left(), IsEmpty()) << signal;
  }
}

TEST_F(LongRun, IsGoneOnWithInTheTimeThatItWasGivenLast) {
  EXPECT_EQ(run(with_signal(command(), "INT")).exit_code, 4);
  const auto outcome =
      run(with_signal("exec env --default-signal TMPDIR=" + quoted(tmp()) + " " + quoted(kProgram) +
                          " characterize --resume --max-time 20min --db " + quoted(database()),
                      "INT"));
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err, HasSubstr("--resume --max-time 20min --db " + database()));
}

TEST_F(LongRun, LeavesSignalsIgnoredThatAreIgnoredWhenItStarts) {
  const auto outcome = run(with_signal(command("", "--ignore-signal=HUP"), "HUP"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(left(), IsEmpty());
}

TEST_F(LongRun, CleansUpWhenNobodyReadsWhatItSays) {
  const auto outcome = run("{ (" + command() + ") 2>&1 >/dev/null; echo $? >" +
                           quoted(scratch_.file("code")) + "; } | true");
  EXPECT_EQ(slurp(scratch_.file("code")), "4\n");
  EXPECT_THAT(left(), IsEmpty());
}

TEST_F(LongRun, RemovesWhatAKilledOneLeft) {
  EXPECT_EQ(run(with_signal(command(), "KILL")).exit_code, 128 + 9);
  EXPECT_THAT(left(), Not(IsEmpty()));
  EXPECT_EQ(run(command()).exit_code, 0);
  EXPECT_THAT(left(), IsEmpty());
}

TEST_F(LongRun, EndsItsWorkersWhenItIsKilled) {
  // Its workers are the processes whose environment has this folder as TMPDIR.
  const std::string workers = "grep -lsz " + quoted("TMPDIR=" + tmp()) + " /proc/[0-9]*/environ";
  const auto outcome =
      // One that is just being started has no environment for a moment: none has to be seen in
      // turn.
      run(with_signal(command(), "KILL") +
          "; i=0; none=0; while [ $none -lt 10 ] && [ $i -lt 1000 ]; do if " + workers +
          " >/dev/null; then none=0; else none=$((none+1)); fi; sleep 0.01; i=$((i+1)); done; "
          "[ $none -ge 10 ] || " +
          workers + "; true");
  EXPECT_EQ(outcome.out, "");
}

TEST_F(LongRun, MakesNoDatabaseWithoutAScratchFolder) {
  for (const auto* place : {"missing", "file"}) {
    scratch_.write("file", "");
    const auto outcome = pirt(
        {"characterize", "--quick", "--platform", "fake", "--filter", "pool5", "--db", database()},
        "TMPDIR=" + quoted(scratch_.file(place)));
    EXPECT_EQ(outcome.exit_code, 4);
    EXPECT_THAT(outcome.err, AllOf(HasSubstr(scratch_.file(place)), HasSubstr("set TMPDIR"),
                                   Not(HasSubstr("internal"))));
    EXPECT_FALSE(std::filesystem::exists(database()));
  }
}

TEST_F(LongRun, RunsWithoutStandardStreams) {
  EXPECT_EQ(run(command() + " <&-").exit_code, 0);
  EXPECT_EQ(run(command() + " 2>&-").exit_code, 0);
  const auto unwritten = run(command() + " >&-");
  EXPECT_EQ(unwritten.exit_code, 4);
  EXPECT_THAT(unwritten.err, HasSubstr("cannot write to standard output"));
  EXPECT_EQ(pirt({"report", database()}).exit_code, 0);
}

TEST_F(LongRun, TwoAtOnceEachShowTheirOwn) {
  const auto outcome = run("(" + command("--seed 1 --json " + quoted(scratch_.file("a"))) +
                           ") & (" + command("--seed 2 --json " + quoted(scratch_.file("b"))) +
                           "); b=$?; wait $!; echo $? $b");
  EXPECT_THAT(outcome.out, HasSubstr("\n0 0\n")) << outcome.err;
  std::set<std::int64_t> runs;
  for (const auto* name : {"a", "b"}) {
    const auto json = nlohmann::json::parse(slurp(scratch_.file(name)));
    const auto run_id = json["summary"]["run_id"].get<std::int64_t>();
    runs.insert(run_id);
    for (const auto& row : json["profile_summary"]) EXPECT_EQ(row["run_id"], run_id);
    EXPECT_FALSE(json["profile_summary"].empty());
  }
  EXPECT_EQ(runs, (std::set<std::int64_t>{1, 2}));
}

TEST_F(LongRun, ShowsItsOwnRunBesideANewerOne) {
  EXPECT_EQ(run(with_signal(command(), "TERM")).exit_code, 4);
  EXPECT_EQ(run(command()).exit_code, 0);
  const auto rest = pirt({"characterize", "--resume", "--db", database(), "--json", "-"});
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  const auto json = rest.json();
  EXPECT_EQ(json["summary"]["run_id"], 1);
  ASSERT_FALSE(json["profile_summary"].empty());
  for (const auto& row : json["profile_summary"]) EXPECT_EQ(row["run_id"], 1);
}

TEST_F(LongRun, IsNotGoneOnWithWhileItIsBeingMeasured) {
  // Until the run is begun there is none that could be gone on with.
  const auto said = quoted(scratch_.file("said"));
  const auto outcome =
      run("(" + command() + ") >/dev/null & while [ ! -e " + quoted(database()) +
          " ]; do sleep 0.01; done; while " + quoted(kProgram) + " characterize --resume --db " +
          quoted(database()) + " 2>" + said + "; code=$?; grep -q 'no unfinished run' " + said +
          " && kill -0 $!; do sleep 0.05; done; cat " + said + " >&2; wait $!; echo $? $code");
  EXPECT_EQ(outcome.out, "0 4\n");
  EXPECT_THAT(outcome.err, HasSubstr("run 1 of profile database"));
  EXPECT_THAT(outcome.err, HasSubstr("is being measured by another program"));
}

}  // namespace
}  // namespace pirt::test
