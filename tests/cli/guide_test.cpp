// What helps somebody who types: --version, the manual, and completion in the shells.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"
#include "workloads/base/text/text.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsSupersetOf;
using testing::Not;

std::vector<std::string> lines(std::string text) {
  if (text.ends_with('\n')) text.pop_back();
  return text.empty() ? std::vector<std::string>{} : split(text, '\n');
}

/// The words that may follow, and behind them the line of what else there is.
std::vector<std::string> offered(std::vector<std::string> words) {
  words.insert(words.begin(), {"complete", "--"});
  const auto outcome = pirt(words);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  auto found = lines(outcome.out);
  for (auto& line : found) line = line.substr(0, line.find('\t'));
  return found;
}

bool has(const std::string& program) { return run("command -v " + program).exit_code == 0; }

TEST(Version, NamesCommitCompilerAndBackends) {
  const auto outcome = pirt({"--version"});
  EXPECT_EQ(outcome.exit_code, 0);
  const auto found = lines(outcome.out);
  ASSERT_EQ(found.size(), 4U) << outcome.out;
  EXPECT_THAT(found[0], testing::MatchesRegex("pirt [0-9]+\\.[0-9]+\\.[0-9]+"));
  EXPECT_THAT(found[1], testing::StartsWith("commit: "));
  EXPECT_THAT(found[2], AllOf(testing::StartsWith("compiler: "),
                              AnyOf(HasSubstr("GCC"), HasSubstr("Clang"))));
  EXPECT_THAT(found[3], testing::StartsWith("backends: cpu"));
}

TEST(Version, CannotBeLost) {
  for (const char* const to : {" >/dev/full", " >&-"}) {
    for (const char* const option : {" --version", " --help"}) {
      const auto outcome = run(quoted(kProgram) + option + to);
      EXPECT_EQ(outcome.exit_code, 4) << option << to;
      EXPECT_THAT(outcome.err, HasSubstr("cannot write to standard output"));
    }
  }
}

TEST(Completion, OffersCommandsTheirKindsAndOptions) {
  EXPECT_THAT(offered({"re"}), ElementsAre("report", "regress", "replay", ":"));
  EXPECT_THAT(offered({""}), AllOf(Contains("schedule"), Not(Contains("worker"))));
  EXPECT_THAT(offered({"generate", "d"}), ElementsAre("dag", ":"));
  EXPECT_THAT(offered({"generate", "dag", "--sh"}), ElementsAre("--shape", ":"));
  EXPECT_THAT(offered({"replay", "--"}), ElementsAre("--help", "--quiet", "--json", ":"));
}

TEST(Completion, LeavesOutWhatTheLineHasOrExcludes) {
  EXPECT_THAT(offered({"replay", "--quiet", "--json", "a", "--"}), ElementsAre("--help", ":"));
  EXPECT_THAT(offered({"schedule", "--compare", "all", "--mo"}), ElementsAre(":"));
  EXPECT_THAT(offered({"schedule", "--set", "cpu.active_w=1", "--se"}),
              ElementsAre("--set", "--seed", ":"));
}

TEST(Completion, OffersTheNamesOfWhatIsShipped) {
  EXPECT_THAT(offered({"schedule", "--mode", "e"}), AllOf(Contains("energy"), Contains("edf")));
  EXPECT_THAT(offered({"schedule", "--mode=ener"}), ElementsAre("--mode=energy", ":"));
  EXPECT_THAT(offered({"schedule", "--platform", "snapdragon820-c"}),
              ElementsAre("snapdragon820-counted", ":files"));
  EXPECT_THAT(offered({"schedule", "--mix", "full"}), Contains("full-robot"));
  EXPECT_THAT(offered({"what-if", "--modes", "edf,ene"}), ElementsAre("edf,energy", ":"));
  EXPECT_THAT(offered({"what-if", "--platform", "snapdragon820-c"}),
              ElementsAre("snapdragon820-counted", ":files"));
  EXPECT_THAT(offered({"what-if", "--mix", "full"}), Contains("full-robot"));
  EXPECT_THAT(offered({"export", "p.db", "--filter", "sob"}), Contains("sobel"));
  EXPECT_THAT(offered({"characterize", "--variants", ""}), Contains("map"));
  EXPECT_THAT(offered({"list", ""}), IsSupersetOf({"workloads", "units", "meters"}));
  EXPECT_THAT(offered({"export", "p.db", "--format", "g"}), ElementsAre("gbench", ":"));
}

TEST(Completion, OffersEachOfAListOnce) {
  EXPECT_THAT(offered({"schedule", "--compare", "latency,energy,laten"}), ElementsAre(":"));
  EXPECT_THAT(offered({"schedule", "--compare", "latency,thr"}),
              ElementsAre("latency,throughput", ":"));
}

TEST(Completion, OffersTheUnitsOfThePlatformThatTheLineNames) {
  EXPECT_THAT(offered({"schedule", "--platform", "snapdragon820", "--weights", ""}),
              ElementsAre("cpu=", "gpu=", "dsp=", ":open"));
  for (const auto* command : {"schedule", "what-if"}) {
    EXPECT_THAT(offered({command, "--platform", "snapdragon820", "--without", "gpu,"}),
                ElementsAre("gpu,cpu", "gpu,dsp", ":"));
  }
  EXPECT_THAT(offered({"schedule", "--platform=snapdragon820", "--weights", "gpu=4,"}),
              ElementsAre("gpu=4,cpu=", "gpu=4,dsp=", ":open"));
  const Scratch scratch;
  const auto platform = scratch.write(
      "b.yaml", "platform: b\nunits: {left: {active_w: 1}, right: {active_w: 1}}\nworkloads: {}\n");
  EXPECT_THAT(offered({"characterize", "--platform", platform, "--units", ""}),
              testing::Each(AnyOf("left", "right", ":")));
  // What cannot be read offers nothing, and is not waited for.
  ASSERT_EQ(run("mkfifo " + scratch.file("pipe.yaml")).exit_code, 0);
  EXPECT_THAT(offered({"characterize", "--platform", scratch.file("pipe.yaml"), "--units", ""}),
              ElementsAre(":"));
}

TEST(Completion, SaysWhereFilesMayStand) {
  EXPECT_THAT(offered({"replay", ""}), ElementsAre(":files"));
  EXPECT_THAT(offered({"replay", "t.json", ""}), ElementsAre(":"));
  EXPECT_THAT(offered({"report", "a.db", ""}), ElementsAre(":files"));
  EXPECT_THAT(offered({"replay", "--json="}), ElementsAre(":files"));
  EXPECT_THAT(offered({"generate", ""}), AllOf(Contains("dag"), Contains(":")));
}

/// @param line   What is typed behind the program.
/// @param words  The same as readline breaks it, at '=' too.
std::vector<std::string> bash_offers(const std::string& line, const std::string& words) {
  const auto outcome = run(
      "bash --norc -c '. /usr/share/bash-completion/bash_completion; . \"" +
      std::string(kSourceFolder) + "/cli/guide/pirt.bash\"; compopt() { :; }; COMP_WORDS=(" +
      kProgram + " " + words + "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); COMP_LINE=\"" + kProgram +
      " " + line + "\"; COMP_POINT=${#COMP_LINE}; _pirt; printf \"%s\\n\" \"${COMPREPLY[@]}\"'");
  EXPECT_EQ(outcome.err, "");
  return lines(outcome.out);
}

TEST(Completion, WorksInBash) {
  if (!std::filesystem::exists("/usr/share/bash-completion/bash_completion")) {
    GTEST_SKIP() << "bash-completion is not installed";
  }
  EXPECT_THAT(bash_offers("sched", "sched"), ElementsAre("schedule"));
  EXPECT_THAT(bash_offers("schedule --mode ener", "schedule --mode ener"), ElementsAre("energy"));
  EXPECT_THAT(bash_offers("schedule --mode=ener", "schedule --mode = ener"), ElementsAre("energy"));
  EXPECT_THAT(bash_offers("schedule --platform snapdragon820 --weights gpu=4,c",
                          "schedule --platform snapdragon820 --weights gpu = 4,c"),
              ElementsAre("4,cpu="));
  const Scratch scratch;
  scratch.write("two words.json", "");
  const auto file = "replay " + scratch.file("two");
  EXPECT_THAT(bash_offers(file, file), ElementsAre(scratch.file("two words.json")));
}

TEST(Completion, WorksInFish) {
  if (!has("fish")) GTEST_SKIP() << "fish is not installed";
  const auto complete = [](const std::string& line) {
    const Scratch home;
    const auto outcome = run("HOME=" + home.file("") + " fish --no-config -c 'source \"" +
                             std::string(kSourceFolder) + "/cli/guide/pirt.fish\"; complete -C \"" +
                             kProgram + " " + line + "\"'");
    EXPECT_EQ(outcome.err, "");
    auto found = lines(outcome.out);
    for (auto& word : found) word = word.substr(0, word.find('\t'));
    return found;
  };
  EXPECT_THAT(complete("sched"), ElementsAre("schedule"));
  EXPECT_THAT(complete("schedule --mode=ener"), ElementsAre("--mode=energy"));
  EXPECT_THAT(complete("schedule --compare latency,thr"), ElementsAre("latency,throughput"));
}

TEST(Completion, WorksInZsh) {
  if (!has("zsh")) GTEST_SKIP() << "zsh is not installed";
  const auto complete = [](const std::string& words) {
    const auto outcome =
        run("zsh -f -c 'compdef() { :; }; compset() { :; }; _files() { print files; }; "
            "compadd() { print -l -- $words_of; }; words=(" +
            std::string(kProgram) + " " + words + "); CURRENT=$#words; . \"" + kSourceFolder +
            "/cli/guide/_pirt\"; _pirt'");
    EXPECT_EQ(outcome.err, "");
    return lines(outcome.out);
  };
  EXPECT_THAT(complete("sched"), ElementsAre("schedule"));
  EXPECT_THAT(complete("schedule --platform snapdragon820-c"),
              ElementsAre("snapdragon820-counted", "files"));
}

TEST(Manual, HasAPageForEachCommandWithWhatHelpSays) {
  const auto names = lines(pirt({"manual"}).out);
  EXPECT_THAT(names, IsSupersetOf({"pirt", "pirt-schedule", "pirt-generate", "pirt-generate-dag"}));
  EXPECT_THAT(names, Not(Contains("pirt-worker")));
  const bool checks = has("mandoc");
  for (const auto& name : names) {
    const auto page = pirt({"manual", name});
    EXPECT_EQ(page.exit_code, 0);
    EXPECT_THAT(page.out, AllOf(HasSubstr(".SH NAME\n"), HasSubstr(".SH OPTIONS\n"))) << name;
    for (const char c : page.out) ASSERT_GE(c, '\n') << name << " has more than ASCII";
    if (!checks) continue;
    const Scratch scratch;
    const auto file = scratch.write(name + ".1", page.out);
    // Without a date it is the same whenever it is built.
    EXPECT_EQ(run("mandoc -T lint -W warning " + file + " | grep -v 'missing date'").out, "");
  }
  expect_refused(pirt({"manual", "pirt-shedule"}), {"pirt-schedule"});
}

TEST(Manual, ReadsAsHelpDoes) {
  if (!has("mandoc")) GTEST_SKIP() << "mandoc is not installed";
  const Scratch scratch;
  const auto file = scratch.write("p.1", pirt({"manual", "pirt-generate-dag"}).out);
  const auto text = run("mandoc -T ascii -O width=1000 " + file + " | sed 's/.\b//g'").out;
  EXPECT_THAT(text,
              AllOf(HasSubstr("Write a random task graph as a mix"), HasSubstr("--shape NUMBER"),
                    HasSubstr("SEE ALSO"), HasSubstr("pirt-generate(1)"),
                    HasSubstr("pirt generate dag --tasks 40 --ccr 0.5 --seed 1 -o dag.yaml")));
}

}  // namespace
}  // namespace pirt::test
