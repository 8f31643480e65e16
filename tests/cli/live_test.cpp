// pirt schedule --live as a process.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

class LiveCommand : public testing::Test {
 protected:
  LiveCommand() {
    scratch_.write("board.yaml", R"(
platform: board
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  dsp: {servers: 1, active_w: 1}
workloads:
  sobel: {cpu: [{on: cpu, ms: 0.5}], dsp: [{on: dsp, ms: 2}]}
)");
    scratch_.write("mix.yaml", R"(
mix: m
pipelines:
  p: {rate_hz: 100, tasks: [{workload: sobel}]}
)");
  }
  [[nodiscard]] std::string command(const std::string& options) const {
    return quoted(kProgram) + " schedule --live --mode ect --platform " +
           quoted(scratch_.file("board.yaml")) + " --mix " + quoted(scratch_.file("mix.yaml")) +
           " --json " + quoted(scratch_.file("run.json")) + " --trace " +
           quoted(scratch_.file("t.json")) + " " + options;
  }
  [[nodiscard]] nlohmann::json record() const {
    return nlohmann::json::parse(slurp(scratch_.file("run.json")));
  }
  const Scratch scratch_;
};

TEST_F(LiveCommand, WritesARecordAndATraceThatReplays) {
  const auto outcome = run(command("--duration 300ms"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("cpu is ready"));
  const auto made = record();
  EXPECT_EQ(made["time"], "live");
  EXPECT_EQ(made["submitted"], 30);
  EXPECT_EQ(pirt({"replay", scratch_.file("t.json")}).exit_code, 0);
}

TEST_F(LiveCommand, RunsWhereStandardErrorTakesNothing) {
  for (const char* const to : {" 2>&-", " 2>/dev/full"}) {
    const auto outcome = run(command("--duration 100ms") + to);
    EXPECT_EQ(outcome.exit_code, 0) << to;
    EXPECT_THAT(outcome.out, HasSubstr("10 tasks submitted")) << to;
  }
}

TEST_F(LiveCommand, KeepsWhatRanWhenItIsInterrupted) {
  const std::string heard = quoted(scratch_.file("heard"));
  const auto outcome =
      run("env --default-signal " + command("--duration 600s") + " 2>" + heard +
          " & pid=$!; until grep -q ready " + heard +
          " || ! kill -0 $pid; do sleep 0.1; done; sleep 0.5; kill -INT $pid; wait $pid; rc=$?; "
          "cat " +
          heard + " >&2; exit $rc");
  ASSERT_EQ(outcome.exit_code, 4) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("stopped by a signal"));
  EXPECT_THAT(outcome.err, Not(HasSubstr("stalled")));
  const auto made = record();
  EXPECT_GT(made["completed"], 0);
  EXPECT_LT(made["makespan_s"], 300);
  EXPECT_EQ(pirt({"replay", scratch_.file("t.json")}).exit_code, 0);
}

// Who looks for what led to a crash finds it.
TEST_F(LiveCommand, ARunThatIsKilledLeavesATraceThatReplays) {
  const std::string trace = quoted(scratch_.file("t.json"));
  // Some seconds of it are there before it is killed.
  const auto outcome = run(command("--duration 600s") +
                           " 2>/dev/null & pid=$!; until [ 20000 -lt $(wc -c <" + trace +
                           " || echo 0) ]; do kill -0 $pid || exit 99; sleep 0.05; done; "
                           "kill -KILL $pid; wait $pid");
  ASSERT_EQ(outcome.exit_code, 128 + 9) << outcome.err;
  EXPECT_FALSE(std::filesystem::exists(scratch_.file("run.json")));
  const auto replayed = pirt({"replay", scratch_.file("t.json"), "--json", "-"});
  EXPECT_EQ(replayed.exit_code, 0) << replayed.err;
  EXPECT_EQ(replayed.json()["complete"], false);
  EXPECT_GT(replayed.json()["decisions"], 10);
  EXPECT_THAT(pirt({"replay", scratch_.file("t.json")}).out, HasSubstr("ends in the middle"));
  // The next run of that name has one of its own, and nothing else is left.
  ASSERT_EQ(run(command("--duration 100ms")).exit_code, 0);
  const auto next = pirt({"replay", scratch_.file("t.json"), "--json", "-"});
  EXPECT_EQ(next.json()["complete"], true);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(scratch_.file("")), {}), 4);
}

// What cannot be had again is written wherever it can be: the disk is full, some way into the run.
TEST_F(LiveCommand, ATraceThatCannotBeWrittenCostsNothingElse) {
  const auto outcome = run("ulimit -f 64; " + command("--duration 2s"));
  EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("t.json"));
  const auto replayed = pirt({"replay", scratch_.file("t.json"), "--json", "-"});
  EXPECT_EQ(replayed.exit_code, 0) << replayed.err;
  EXPECT_EQ(replayed.json()["complete"], false);
  EXPECT_EQ(record()["submitted"], 200);
  EXPECT_THAT(outcome.out, HasSubstr("200 tasks submitted"));
}

TEST_F(LiveCommand, AStartThatHangsCanBeInterrupted) {
  scratch_.write("hangs.yaml", R"(
platform: hangs
units:
  gpu: {backend: fake, active_w: 1, script: {hang: [sobel]}}
workloads: {sobel: {gpu: [{on: gpu, ms: 0.5}]}}
)");
  const std::string heard = quoted(scratch_.file("heard"));
  const auto outcome = run(
      "env --default-signal " + quoted(kProgram) + " schedule --live --mode ect --platform " +
      quoted(scratch_.file("hangs.yaml")) + " --mix " + quoted(scratch_.file("mix.yaml")) + " 2>" +
      heard + " & pid=$!; until grep -q opening " + heard +
      " || ! kill -0 $pid; do sleep 0.1; done; sleep 0.3; kill -INT $pid; wait $pid; rc=$?; cat " +
      heard + " >&2; exit $rc");
  EXPECT_EQ(outcome.exit_code, 4) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("interrupted while unit gpu was being prepared"));
}

/// A unit that takes as long as its script says.
/// @param clock  "simulated" or "wall".
std::string slow_board(const std::string& clock, int ms) {
  return "platform: slow\nunits: {gpu: {backend: fake, slots: 1, active_w: 1, script: {clock: " +
         clock + ", stages: {pool5: [{name: execute, ms: " + std::to_string(ms) + "}]}}}}\n";
}

/// A profile of pool5 on one that takes a millisecond.
std::string slow_profile(const Scratch& scratch) {
  std::string db = scratch.file("p.db");
  const auto made = pirt({"characterize", "--quick", "--filter", "^pool5$", "--db", db,
                          "--platform", scratch.write("was.yaml", slow_board("simulated", 1))});
  EXPECT_EQ(made.exit_code, 0) << made.err;
  return db;
}

constexpr const char* kPoolMix = R"(
mix: m
pipelines: {p: {closed_loop: {frames: 30}, tasks: [{workload: pool5}]}}
)";

TEST_F(LiveCommand, RowsThatTheRunContradictsAreMeasuredAnew) {
  const std::string db = slow_profile(scratch_);
  const auto mix = scratch_.write("pool.yaml", kPoolMix);
  const auto outcome = pirt({"schedule", "--live", "--mode", "olb", "--profile", db, "--platform",
                             scratch_.write("is.yaml", slow_board("wall", 20)), "--mix", mix,
                             "--in-flight", "1", "--update-profile"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("run 2 has what the live run contradicts, measured anew: "
                                     "pool5 on gpu"));
  int calls = 0;
  const auto exported = pirt({"export", db, "--format", "json"}).json();
  for (const auto& row : exported["profile_summary"]) {
    if (row["state"] != "steady") continue;
    EXPECT_EQ(row["run_id"], 2);
    EXPECT_EQ(row["provenance"], "measured");
    EXPECT_EQ(row["samples"], 30);
    EXPECT_THAT(row["notes"].dump(), HasSubstr("live"));
    if (row["phase"] != "call") continue;
    ++calls;
    EXPECT_GE(row["median_ns"], 20'000'000);
  }
  EXPECT_EQ(calls, 1);
  ASSERT_EQ(exported["energy_summary"].size(), 1U);
  EXPECT_GE(exported["energy_summary"][0]["energy_j"], 0.020);  // 1 W.
  EXPECT_THAT(pirt({"report", db}).out, HasSubstr("live"));
  // The set-up stays known, and virtual time takes what was measured last.
  const auto again = pirt({"schedule", "--mode", "olb", "--profile", db, "--platform",
                           scratch_.file("is.yaml"), "--mix", mix, "--json", "-"});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_GE(again.json()["makespan_s"], 0.6);
}

TEST_F(LiveCommand, AProfileThatCannotBeUpdatedCostsNoResult) {
  const std::string db = slow_profile(scratch_);
  const auto mix = scratch_.write("pool.yaml", kPoolMix);
  std::string command = "ulimit -f 32; " + quoted(kProgram);  // The database is larger.
  for (const std::string& argument : std::vector<std::string>{
           "schedule", "--live", "--mode", "olb", "--profile", db, "--platform",
           scratch_.write("is.yaml", slow_board("wall", 5)), "--mix", mix, "--in-flight", "1",
           "--update-profile", "--json", scratch_.file("run.json")}) {
    command += " " + quoted(argument);
  }
  const auto outcome = run(command);
  EXPECT_EQ(outcome.exit_code, 4) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr(db));
  EXPECT_THAT(outcome.out, HasSubstr("olb"));
  EXPECT_EQ(record()["completed"], 30);
}

TEST_F(LiveCommand, AUnitWithAClockOfItsOwnContradictsNoRow) {
  const std::string db = scratch_.file("p.db");
  const auto board = scratch_.write("slow.yaml", slow_board("simulated", 500));
  const auto made =
      pirt({"characterize", "--quick", "--filter", "^pool5$", "--db", db, "--platform", board});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto mix = scratch_.write("pool.yaml", R"(
mix: m
pipelines: {p: {closed_loop: {frames: 30}, tasks: [{workload: pool5}]}}
)");
  const auto outcome =
      pirt({"schedule", "--live", "--mode", "olb", "--profile", db, "--platform", board, "--mix",
            mix, "--update-profile", "--json", scratch_.file("live.json")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("contradicts no row"));
  EXPECT_EQ(nlohmann::json::parse(slurp(scratch_.file("live.json")))["units"]["gpu"]["own_clock"],
            true);
  const auto report = pirt({"report", db, scratch_.file("live.json")});
  EXPECT_THAT(report.out, HasSubstr("own clock"));
  EXPECT_THAT(report.out, testing::Not(HasSubstr("✗ contradicted")));
}

TEST_F(LiveCommand, UpdatesNoProfileThatItDoesNotHave) {
  const std::vector<std::string> virtually = {"schedule", "--mode",     "ect",
                                              "--mix",    "full-robot", "--update-profile"};
  auto with_profile = virtually;
  with_profile.insert(with_profile.end(), {"--profile", scratch_.file("p.db")});
  expect_refused(pirt(with_profile), {"--update-profile", "--live"});
  auto without = virtually;
  without.insert(without.end(), {"--live", "--platform", scratch_.file("board.yaml")});
  expect_refused(pirt(without), {"--update-profile", "--profile"});
}

TEST_F(LiveCommand, ContextsNeedOneServerLiveToo) {
  const auto board = scratch_.write(
      "contexts.yaml", "platform: b\nunits: {fpga: {servers: 2, contexts: {}, active_w: 1}}\n");
  expect_refused(pirt({"schedule", "--live", "--mode", "ect", "--platform", board, "--mix",
                       scratch_.file("mix.yaml")}),
                 {"contexts", "one server"});
}

TEST_F(LiveCommand, OptionsOfLiveRunsAreForThem) {
  expect_refused(pirt({"schedule", "--mode", "ect", "--platform", "snapdragon820", "--mix",
                       "convolution-1000", "--no-preinit"}),
                 {"--live"});
  expect_refused(pirt({"schedule", "--compare", "ect", "--live", "--platform", "snapdragon820",
                       "--mix", "convolution-1000"}),
                 {"--compare"});
}

TEST(ScheduleCommand, FaultsThatCannotBeMeantAreRefusedWithWhatTheyAre) {
  const auto faults = [](const std::string& text) {
    return pirt({"schedule", "--mode", "ect", "--platform", "snapdragon820", "--mix",
                 "convolution-1000", "--faults", text});
  };
  expect_refused(faults("seed=7,seed=8"), {"seed", "twice"});
  expect_refused(faults("seed=7,fail=1"), {"fail=1", "return=0.02"});
}

TEST(ScheduleCommand, AnUnknownMixIsNamedFirst) {
  expect_refused(pirt({"schedule", "--mode", "ect", "--mix", "full-rowboat"}), {"full-robot"});
}

// The paper's watts are fitted; with others, no joule of the run is.
TEST(ScheduleCommand, WattsThatAreSetMakeJoulesAnAssumption) {
  const auto with = [](std::vector<std::string> more) {
    more.insert(more.begin(), {"schedule", "--mode", "throughput", "--platform", "snapdragon820",
                               "--mix", "convolution-1000", "--json", "-"});
    return pirt(more).json()["units"]["gpu"]["energy_provenance"];
  };
  EXPECT_EQ(with({}), nlohmann::json({"fitted"}));
  EXPECT_EQ(with({"--set", "cpu.active_w=100"}), nlohmann::json({"modelled"}));
}

TEST(ScheduleCommand, AFallbackIsForModesThatFallBack) {
  const auto scheduled = [](const std::string& how, const std::string& modes) {
    return pirt({"schedule", how, modes, "--basic", "ect", "--platform", "snapdragon820", "--mix",
                 "convolution-1000"});
  };
  expect_refused(scheduled("--mode", "olb"), {"--basic", "advanced"});
  expect_refused(scheduled("--compare", "olb,edf"), {"--basic", "advanced"});
  const auto falls_back = scheduled("--compare", "olb,advanced");
  EXPECT_EQ(falls_back.exit_code, 0) << falls_back.err;
}

}  // namespace
}  // namespace pirt::test
