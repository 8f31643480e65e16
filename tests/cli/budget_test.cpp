// Mode budget, what-if and the frontier on the command line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

TEST(BudgetCommand, PlansAndKeepsToItsGoals) {
  const auto run = [](std::vector<std::string> more) {
    std::vector<std::string> arguments = {"schedule", "--platform",       "snapdragon820",
                                          "--mix",    "convolution-1000", "--mode",
                                          "budget",   "--json",           "-"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto outcome = pirt(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.json();
  };
  const auto fast = run({});
  EXPECT_EQ(fast.at("objective"), "rate");
  const auto frugal = run({"--objective", "energy", "--min-rate", "0.4"});
  EXPECT_EQ(frugal.at("min_rate_per_ms"), 0.4);
  EXPECT_GE(frugal.at("throughput_per_ms").get<double>(), 0.4);
  EXPECT_LT(frugal.at("energy_j").get<double>(), fast.at("energy_j").get<double>());
  const auto capped = run({"--power-cap", "1500mW"});
  EXPECT_EQ(capped.at("power_cap_w"), 1.5);
  EXPECT_LE(capped.at("power_highest_w").get<double>(), 1.5);
  EXPECT_EQ(run({"--in-flight", "4"}).at("in_flight"), 4);
}

TEST(BudgetCommand, SaysWhatIsGuaranteed) {
  const auto outcome =
      pirt({"schedule", "--platform", "fake", "--mode", "budget", "--duration", "5s"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("guaranteed"));
  EXPECT_THAT(outcome.out, HasSubstr("at most"));
}

TEST(BudgetCommand, ACapBelowIdlePowerIsInfeasible) {
  const auto outcome =
      pirt({"schedule", "--platform", "fake", "--mode", "budget", "--power-cap", "0.3W"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("--power-cap 0.3 W is infeasible"));
  EXPECT_EQ(outcome.out, "");
  const auto unheard =
      run(quoted(kProgram) + " schedule --platform fake --mode budget --power-cap 0.3W 2>&-");
  EXPECT_EQ(unheard.exit_code, 1);
}

TEST(BudgetCommand, RefusesWhatIsNoGoal) {
  const auto schedule = [](const std::string& mode, const std::string& option,
                           const std::string& value) {
    return pirt({"schedule", "--platform", "fake", "--mode", mode, option, value});
  };
  expect_refused(schedule("budget", "--power-cap", "11V"), {"--power-cap", "11W"});
  expect_refused(schedule("budget", "--power-cap", "0W"), {"--power-cap"});
  expect_refused(schedule("budget", "--min-rate", "-1"), {"--min-rate"});
  expect_refused(schedule("budget", "--objective", "rat"), {"--objective", "rate"});
  expect_refused(schedule("edf", "--objective", "rate"), {"about mode budget"});
  expect_refused(schedule("edf", "--without", "gpuu"), {"gpuu", "did you mean gpu"});
  expect_refused(
      pirt({"schedule", "--platform", "fake", "--compare", "edf,ect", "--power-cap", "5W"}),
      {"about mode budget", "none of these"});
}

TEST(ParetoCommand, ShowsWhoIsBeaten) {
  const std::vector<std::string> arguments = {"schedule", "--platform",       "snapdragon820",
                                              "--mix",    "convolution-1000", "--pareto"};
  const auto text = pirt(arguments);
  EXPECT_EQ(text.exit_code, 0) << text.err;
  for (const char* part : {"budget, rate", "budget, energy", "throughput", "nobody"}) {
    EXPECT_THAT(text.out, HasSubstr(part));
  }
  auto with_json = arguments;
  with_json.insert(with_json.end(), {"--json", "-"});
  const auto json = pirt(with_json).json();
  EXPECT_GT(json.at("points").size(), 10U);
  EXPECT_GT(json.at("bounds").at("throughput_per_ms").get<double>(), 0.8);
  EXPECT_EQ(pirt({"schedule", "--platform", "fake", "--pareto", "--mode", "edf"}).exit_code, 2);
}

TEST(WhatIfCommand, NamesWhatBreaksInTextMarkdownAndJson) {
  const Scratch scratch;
  const std::string markdown = scratch.file("what.md");
  const auto outcome = pirt({"what-if", "--mix", "section5", "--platform", "snapdragon820-section5",
                             "--power-cap", "11W", "--duration", "5s", "--modes",
                             "throughput,budget", "--markdown", markdown, "--json", "-"});
  EXPECT_LE(outcome.exit_code, 1) << outcome.err;
  const auto json = outcome.json();
  EXPECT_EQ(json.at("parameter"), "all rates, times");
  ASSERT_EQ(json.at("modes").size(), 2U);
  for (const auto& mode : json.at("modes")) {
    ASSERT_TRUE(mode.contains("breakage")) << mode;
    EXPECT_NE(mode.at("breakage").at("resource"), "");
  }
  std::ifstream file(markdown);
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  EXPECT_THAT(text, HasSubstr("| throughput"));
  expect_refused(pirt({"what-if", "--platform", "fake", "--raise", "localisation.rate_hz"}),
                 {"localisation.rate_hz", "did you mean localization.rate_hz"});
  expect_refused(pirt({"what-if", "--platform", "fake", "--lower", "power-cap"}), {"--power-cap"});
  expect_refused(pirt({"what-if", "--platform", "fake", "--lower", "rate"}), {"--lower"});
}

}  // namespace
}  // namespace pirt::test
