// pirt schedule --live as a process.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

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
    return quoted(PIRT_BINARY) + " schedule --live --mode ect --platform " +
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

TEST_F(LiveCommand, KeepsWhatRanWhenItIsInterrupted) {
  const std::string heard = quoted(scratch_.file("heard"));
  const auto outcome = run("env --default-signal " + command("--duration 600s") + " 2>" + heard +
                           " & pid=$!; until grep -q ready " + heard +
                           "; do sleep 0.1; done; sleep 0.5; kill -INT $pid; wait $pid; rc=$?; "
                           "cat " +
                           heard + " >&2; exit $rc");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("stopped by a signal"));
  const auto made = record();
  EXPECT_GT(made["completed"], 0);
  EXPECT_LT(made["makespan_s"], 300);
  EXPECT_EQ(pirt({"replay", scratch_.file("t.json")}).exit_code, 0);
}

TEST_F(LiveCommand, OptionsOfLiveRunsAreForThem) {
  expect_refused(pirt({"schedule", "--mode", "ect", "--platform", "snapdragon820", "--mix",
                       "convolution-1000", "--no-preinit"}),
                 {"--live"});
  expect_refused(pirt({"schedule", "--compare", "ect", "--live", "--platform", "snapdragon820",
                       "--mix", "convolution-1000"}),
                 {"--compare"});
}

}  // namespace
}  // namespace pirt::test
