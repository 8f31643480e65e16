// Values of options: read strictly, and refused with the option, the value and what it may be.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

struct NumberOption {
  std::vector<std::string> command;  ///< Up to the value.
  std::string range;                 ///< As the message says it.
};

std::vector<NumberOption> whole_numbers() {
  const std::string seed = "between 0 and 18446744073709551615";
  return {{{"characterize", "--seed"}, seed},
          {{"tune", "--seed"}, seed},
          {{"schedule", "--seed"}, seed},
          {{"regress", "--seed"}, seed},
          {{"sample", "--workload", "sobel", "--seed"}, seed},
          {{"generate", "dag", "--seed"}, seed},
          {{"schedule", "--in-flight"}, "between 1 and 1000000"},
          {{"characterize", "--batch"}, "between 2 and 256"},
          {{"generate", "dag", "--tasks"}, "between 1 and 10000"},
          {{"generate", "dag", "--out-degree"}, "between 1 and 10000"}};
}

std::vector<NumberOption> decimals() {
  return {{{"generate", "dag", "--shape"}, "between 0 and 100"},
          {{"generate", "dag", "--ccr"}, "between 0 and 1000"},
          {{"generate", "dag", "--heterogeneity"}, "between 0 and 2"},
          {{"generate", "dag", "--mean-ms"}, "between 0 and 1000000"},
          {{"doctor", "--seconds"}, "3600"}};
}

std::vector<NumberOption> with_units() {
  return {{{"characterize", "--precision"}, "between 0 and 1"},
          {{"characterize", "--max-time"}, "between 1 ns and 10 years"},
          {{"tune", "--max-time"}, "between 1 ns and 10 years"},
          {{"regress", "--max-time"}, "between 1 ns and 10 years"},
          {{"regress", "--work"}, "between 1 ns and 10 years"},
          {{"regress", "--sample-limit"}, "between 1 ns and 10 years"},
          {{"schedule", "--duration"}, "between 1 ns and 10 years"}};
}

void expect_all_refused(const std::vector<NumberOption>& options,
                        const std::vector<std::string>& values) {
  for (const auto& option : options) {
    for (const auto& value : values) {
      auto arguments = option.command;
      arguments.push_back(value);
      expect_refused(pirt(arguments), {option.command.back(), "'" + value + "'", option.range});
    }
  }
}

TEST(OptionValues, AreNotAnotherNumberThanWhatIsWritten) {
  expect_all_refused(whole_numbers(), {"-1", "18446744073709551616", "", "010", "0x10", " 5", "+5",
                                       "1e3", "2.0", "5x", "nan"});
}

TEST(OptionValues, ThatAreDecimalsAreFinite) {
  expect_all_refused(decimals(), {"", "-1", "nan", "inf", "1e999", "1e-999", "0x1p3", "1,5", " 1"});
}

TEST(OptionValues, WithUnitsHaveANumberBeforeThem) {
  expect_all_refused(with_units(), {"", "010s", "0x10s", "-5s", "+5s", "5 s", "s", "%", "nan",
                                    "inf", "1e999s", "5fortnights", "0"});
}

TEST(OptionValues, ThatAreWeightsAreWholeNumbers) {
  for (const auto* bad : {"gpu=04", "gpu=-1", "gpu=+1", "gpu=", "=1", "gpu", "gpu=1e3",
                          "gpu=99999999999", "gpu=1,", ""}) {
    expect_refused(pirt({"schedule", "--mode", "latency", "--platform", "snapdragon820", "--mix",
                         "convolution-1000", "--weights", bad}),
                   {"--weights", "UNIT=WEIGHT", "between 0 and 1000000"});
  }
}

TEST(OptionValues, TakeTheEndsOfTheirRange) {
  for (const auto* seed : {"0", "18446744073709551615"}) {
    const auto outcome = pirt({"schedule", "--mode", "met", "--platform", "snapdragon820", "--mix",
                               "convolution-1000", "--seed", seed, "--json", "-"});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(std::to_string(outcome.json()["seed"].get<std::uint64_t>()), seed);
  }
  EXPECT_EQ(pirt({"generate", "dag", "--tasks", "1", "--ccr", "0"}).exit_code, 0);
}

TEST(OptionValues, AreNotEmpty) {
  expect_refused(pirt({"characterize", "--units", "", "--db", "p.db"}), {"--units", "empty"});
  expect_refused(pirt({"schedule", "--mode", ""}), {"--mode", "empty"});
}

TEST(Filter, EndsInEveryCommand) {
  const std::vector<std::vector<std::string>> commands = {
      {"characterize", "--platform", "fake", "--dry-run"},
      {"tune", "--dry-run"},
      {"regress", "a.db", "b.db"},
      {"diff", "a.db", "b.db"},
      {"export", "a.db", "--format", "csv"}};
  const std::string deep = std::string(10'000, '(') + std::string(10'000, ')');
  for (auto command : commands) {
    const auto with = [&command](const std::string& filter) {
      auto arguments = command;
      arguments.insert(arguments.end(), {"--filter", filter});
      return pirt(arguments);
    };
    expect_refused(with(deep), {"--filter", "20000 characters"});
    expect_refused(with("(?!sobel)"), {"--filter", "look-ahead"});
    expect_refused(with("(.)\\1"), {"--filter", "back-references"});
    EXPECT_THAT(pirt({command.front(), "--help"}).out, HasSubstr("RE2"));
  }
  expect_refused(
      pirt({"characterize", "--platform", "fake", "--dry-run", "--filter", "(.*)*(.*)*(.*)*zz"}),
      {"matches no workload"});
}

TEST(Arguments, AfterTheMarkAreNoOptions) {
  EXPECT_EQ(pirt({"list", "--", "modes"}).exit_code, 0);
  EXPECT_EQ(pirt({"list", "modes", "--"}).exit_code, 0);
  EXPECT_EQ(pirt({"--", "list", "modes"}).exit_code, 0);
  expect_refused(pirt({"replay", "--", "--json"}), {"'--json'", "No such file"});
  expect_refused(pirt({"list", "modes", "--", "more"}), {"'more'"});
}

TEST(Suggestions, NameEachOnce) {
  const Scratch scratch;
  const auto mix = scratch.write("m.yaml",
                                 "mix: m\npipelines: {p: {closed_loop: {frames: 1}, tasks: "
                                 "[{workload: convolution, eligible: [cpuu]}]}}\n");
  const auto outcome =
      pirt({"schedule", "--mode", "met", "--platform", "snapdragon820", "--mix", mix});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("did you mean cpu"));
  EXPECT_THAT(outcome.err, testing::Not(testing::ContainsRegex("cpu.*, cpu")));
}

}  // namespace
}  // namespace pirt::test
