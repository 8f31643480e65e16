// Traces of runs and their replay, and what a drawn run is, through the program.
#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::vector<std::string> convolutions(const std::string& trace) {
  return {"schedule", "--mode",           "energy",  "--platform", "snapdragon820",
          "--mix",    "convolution-1000", "--trace", trace};
}

TEST(Replay, ExitsWithWhatItFound) {
  const Scratch scratch;
  const auto trace = scratch.file("t.json");
  ASSERT_EQ(pirt(convolutions(trace)).exit_code, 0);
  const auto same = pirt({"replay", trace, "--json", "-"});
  EXPECT_EQ(same.exit_code, 0) << same.err;
  EXPECT_EQ(same.json()["decisions"], 1000);
  EXPECT_EQ(same.json()["same"], true);

  auto json = nlohmann::json::parse(slurp(trace));
  const auto first = std::ranges::find_if(
      json, [](const auto& line) { return line.value("name", "") == "pirt log"; });
  (*first)["args"]["start"][0][1] = 0;  // The CPU, which energy mode does not use here.
  const auto altered = pirt({"replay", scratch.write("altered.json", json.dump())});
  EXPECT_EQ(altered.exit_code, 1);
  EXPECT_THAT(altered.out,
              AllOf(HasSubstr("input 1 of 3000"), HasSubstr("on cpu"), HasSubstr("on dsp")));
}

TEST(Replay, RefusesWhatIsNoTrace) {
  const Scratch scratch;
  const auto trace = scratch.file("t.json");
  ASSERT_EQ(pirt(convolutions(trace)).exit_code, 0);
  const auto text = slurp(trace);
  expect_refused(pirt({"replay", scratch.write("cut.json", text.substr(0, 100))}), {"cut.json"});
  expect_refused(pirt({"replay", scratch.file("none.json")}), {"none.json"});
}

TEST(Trace, IsOfOneRunAndWritable) {
  const Scratch scratch;
  expect_refused(
      pirt({"schedule", "--compare", "--platform", "fake", "--trace", scratch.file("t.json")}),
      {"--trace", "--compare"});
  expect_refused(pirt(convolutions(scratch.file("none/t.json"))), {"none/t.json"});
}

TEST(Draw, NeedsAProfileAndAKnownName) {
  expect_refused(pirt({"schedule", "--mode", "ect", "--platform", "fake", "--draw", "p95"}),
                 {"--draw p95", "--profile"});
  expect_refused(pirt({"schedule", "--mode", "ect", "--platform", "fake", "--draw", "p59"}),
                 {"'p59'", "p95"});
}

}  // namespace
}  // namespace pirt::test
