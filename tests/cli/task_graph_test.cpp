// Task graphs on the command line: generate one, schedule it by plan, and every refusal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

constexpr const char* kPlatform = R"(platform: three
units:
  cpu: {servers: 1, discipline: fifo}
  gpu: {servers: 1, discipline: fifo}
  dsp: {servers: 1, discipline: fifo}
)";

TEST(GenerateDag, WritesAMixThatRunsAsPlanned) {
  const Scratch scratch;
  const auto platform = scratch.write("three.yaml", kPlatform);
  const auto dag = scratch.file("dag.yaml");
  const auto generated =
      pirt({"generate", "dag", "--tasks", "40", "--shape", "1", "--out-degree", "3", "--ccr", "0.5",
            "--heterogeneity", "0.5", "--units", "cpu,gpu,dsp", "--seed", "1", "-o", dag});
  ASSERT_EQ(generated.exit_code, 0) << generated.err;
  for (const char* mode : {"heft", "cpop", "peft", "etf", "shortest"}) {
    const auto outcome =
        pirt({"schedule", "--mix", dag, "--platform", platform, "--mode", mode, "--json", "-"});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const auto json = outcome.json();
    EXPECT_EQ(json.at("completed"), 40) << mode;
    EXPECT_EQ(json.at("planned_makespan_s"), json.at("makespan_s")) << mode;
  }
}

TEST(GenerateDag, SameSeedSameBytes) {
  const auto first = pirt({"generate", "dag", "--seed", "7"});
  EXPECT_EQ(first.exit_code, 0);
  EXPECT_EQ(first.out, pirt({"generate", "dag", "--seed", "7"}).out);
  EXPECT_NE(first.out, pirt({"generate", "dag", "--seed", "8"}).out);
}

TEST(GenerateDag, RefusesBadParametersAndWritesNothing) {
  const Scratch scratch;
  const auto dag = scratch.file("dag.yaml");
  const std::vector<std::pair<std::string, std::string>> bad = {
      {"--tasks", "0"},      {"--tasks", "many"},  {"--shape", "0"},       {"--shape", "nan"},
      {"--out-degree", "0"}, {"--ccr", "-1"},      {"--ccr", "inf"},       {"--heterogeneity", "3"},
      {"--mean-ms", "0"},    {"--units", "cpu,,"}, {"--units", "cpu,cpu"}, {"--seed", "-1"}};
  for (const auto& [option, value] : bad) {
    const auto outcome = pirt({"generate", "dag", option, value, "-o", dag});
    EXPECT_EQ(outcome.exit_code, 2) << option << ' ' << value;
    EXPECT_THAT(outcome.err, HasSubstr(option)) << value;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(dag));
  }
}

TEST(TaskGraph, RefusesACycleAndAnUnknownUnitWithTheirPlace) {
  const Scratch scratch;
  const auto refused = [&](const std::string& tasks) {
    const auto mix = scratch.write(
        "bad.yaml",
        "mix: bad\npipelines:\n  p:\n    closed_loop: {frames: 1}\n    tasks:\n" + tasks);
    const auto outcome = pirt({"schedule", "--mix", mix, "--platform",
                               scratch.write("p.yaml", kPlatform), "--mode", "heft"});
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(outcome.out, "");
    return outcome.err;
  };
  EXPECT_THAT(refused("      - {name: a, service_ms: {cpu: 1}, after: [b]}\n"
                      "      - {name: b, service_ms: {cpu: 1}, after: [a]}\n"),
              testing::AllOf(HasSubstr("bad.yaml:"), HasSubstr("a -> b -> a")));
  EXPECT_THAT(refused("      - {name: a, service_ms: {gpuu: 1}}\n"),
              testing::AllOf(HasSubstr("bad.yaml:6"), HasSubstr("'gpuu'"), HasSubstr("gpu")));
  EXPECT_THAT(refused("      - {name: a, service_ms: {cpu: .nan}}\n"), HasSubstr("bad.yaml:6"));
}

TEST(List, ShowsEveryMode) {
  const auto outcome = pirt({"list", "modes"});
  EXPECT_EQ(outcome.exit_code, 0);
  for (const char* mode : {"latency", "throughput", "energy", "advanced", "cpu-only", "met", "olb",
                           "ect", "edf", "qilin", "etf", "heft", "cpop", "peft", "shortest"}) {
    EXPECT_THAT(outcome.out, HasSubstr(mode));
  }
}

}  // namespace
}  // namespace pirt::test
