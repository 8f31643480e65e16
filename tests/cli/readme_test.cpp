// What README shows is what the program prints, and who wins there does.
#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::SizeIs;

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// The lines of the fenced block behind the one that holds @p command.
std::vector<std::string> shown_behind(const std::string& command) {
  const auto lines = lines_of(slurp(std::string(kSourceFolder) + "/README.md"));
  auto line = std::ranges::find_if(
      lines, [&](const std::string& each) { return each.find(command) != std::string::npos; });
  const auto fence = [&] {
    return std::find_if(line, lines.end(),
                        [](const std::string& each) { return each.starts_with("```"); });
  };
  for (int i = 0; i < 2 && line != lines.end(); ++i) line = fence() + 1;
  const auto end = fence();
  return {line, end};
}

/// The block of README that begins with @p line, up to its end.
std::string block_with(const std::string& line) {
  const auto readme = slurp(std::string(kSourceFolder) + "/README.md");
  const auto begin = readme.find(line);
  EXPECT_NE(begin, std::string::npos);
  return readme.substr(begin, readme.find("```", begin) - begin);
}

TEST(Readme, ARobotInTenLinesIsScheduled) {
  const Scratch scratch;
  const std::string text = block_with("mix: mine");
  EXPECT_LE(std::ranges::count(text, '\n'), 10);
  const auto mix = scratch.write("robot.yaml", text);
  const auto outcome =
      pirt({"schedule", "--platform", "fake", "--mix", mix, "--compare", "latency,ect,edf,budget"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("Take "), HasSubstr("camera, p99 of 33.0 ms")));
}

TEST(Readme, AKernelInTwentyLinesIsMeasuredAndScheduled) {
  const Scratch scratch;
  const std::string text = block_with("#include <pirt/module.hpp>");
  EXPECT_LE(std::ranges::count(text, '\n'), 20);
  const auto source = scratch.write("mine.cpp", text);
  const auto include = std::filesystem::path(kProgram).parent_path() / "include";
  const auto built = run("c++ -std=c++17 -O2 -fPIC -shared -fvisibility=hidden -Wall -Wextra -I" +
                         quoted(include.string()) + " " + quoted(source) + " -o " +
                         quoted(scratch.file("libmine.so")));
  ASSERT_EQ(built.exit_code, 0) << built.err;
  EXPECT_EQ(built.err, "");
  const auto measured = pirt({"characterize", "--workloads", scratch.file("libmine.so"), "--units",
                              "cpu", "--quick", "--max-time", "10s", "--db", scratch.file("p.db")});
  ASSERT_EQ(measured.exit_code, 0) << measured.err;
  const auto mix = scratch.write("mine.yaml",
                                 "mix: mine\npipelines:\n  a: {rate_hz: 30, deadline_ms: 33, "
                                 "tasks: [{name: t, workload: mine.threshold}]}\n");
  const auto outcome = pirt(
      {"schedule", "--mix", mix, "--profile", scratch.file("p.db"), "--compare", "ect,budget"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
}

TEST(Readme, FirstResultIsWhatItsCommandPrints) {
  const std::string command =
      "schedule --platform snapdragon820 --mix convolution-1000 --compare "
      "cpu-only,latency,throughput,energy,edf";
  const auto shown = shown_behind(command);
  ASSERT_GT(shown.size(), 8U);
  const auto printed = run(quoted(kProgram) + " " + command);
  ASSERT_EQ(printed.exit_code, 0) << printed.err;
  const auto lines = lines_of(printed.out);
  for (const std::string& line : shown) {
    if (line != "...") {
      EXPECT_THAT(lines, testing::Contains(line));
    }
  }
}

TEST(Readme, BudgetIsFasterThanAllAndCheaperThanAllButTwo) {
  const std::string on = "schedule --platform snapdragon820 --mix convolution-1000 --json - ";
  const auto others =
      run(quoted(kProgram) + " " + on + "--compare cpu-only,latency,throughput,energy,edf").json();
  const auto budget = run(quoted(kProgram) + " " + on + "--mode budget").json();
  EXPECT_NEAR(budget["throughput_per_ms"].get<double>(), 0.80, 0.005);
  EXPECT_NEAR(budget["energy_j"].get<double>(), 4.5, 0.06);
  for (const auto& each : others["runs"]) {
    EXPECT_GT(budget["throughput_per_ms"], each["throughput_per_ms"]) << each["mode"];
    const bool gives_up_rate = each["mode"] == "latency" || each["mode"] == "energy";
    EXPECT_EQ(budget["energy_j"] < each["energy_j"], !gives_up_rate) << each["mode"];
  }
}

TEST(Modelled, ABoardGetsAPageWithoutADatabase) {
  const Scratch scratch;
  const auto on =
      std::vector<std::string>{"--platform", "snapdragon820", "--mix", "convolution-1000"};
  for (const char* kind : {"text", "page", "compare"}) {
    std::vector<std::string> arguments = {"report", kind};
    arguments.insert(arguments.end(), on.begin(), on.end());
    const auto made = pirt(arguments);
    EXPECT_EQ(made.exit_code, 0) << made.err;
    EXPECT_THAT(made.out, AllOf(HasSubstr("Take "), HasSubstr("throughput"))) << kind;
  }
  const auto record = pirt({"schedule", "--mode", "edf", "--platform", "snapdragon820", "--mix",
                            "convolution-1000", "--json", scratch.file("edf.json")});
  ASSERT_EQ(record.exit_code, 0) << record.err;
  for (const char* kind : {"text", "page"}) {
    const auto made = pirt({"report", kind, scratch.file("edf.json")});
    EXPECT_EQ(made.exit_code, 0) << made.err;
    EXPECT_THAT(made.out, HasSubstr("edf"));
  }
  const auto json = pirt({"report", "text", scratch.file("edf.json"), "--json", "-"});
  EXPECT_THAT(json.json()["modes"], SizeIs(1));
  const auto nothing = pirt({"report", "text"});
  EXPECT_EQ(nothing.exit_code, 2);
  EXPECT_THAT(nothing.err, HasSubstr("or give --platform"));
}

}  // namespace
}  // namespace pirt::test
