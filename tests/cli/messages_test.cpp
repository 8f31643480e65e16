// What the program says: what went wrong and where, what an option does not do, its range; and
// nothing when asked to be quiet.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kMix = "mix: m\npipelines: {p: {rate_hz: 10, tasks: [{workload: sobel}]}}\n";

/// A platform whose unit `gpu` is made by @p script.
std::string board(const std::string& script, const std::string& ms = "1") {
  return "platform: board\nunits:\n  gpu: {backend: fake, slots: 1, active_w: 1, script: {" +
         script + "}}\nworkloads:\n  sobel: {gpu: [{name: execute, on: gpu, ms: " + ms + "}]}\n";
}

TEST(Messages, NameTheUnitThatDoesNotOpen) {
  const Scratch scratch;
  const auto platform = scratch.write("b.yaml", board("fail_open: no such thing"));
  const auto mix = scratch.write("m.yaml", kMix);
  const auto outcome = pirt({"schedule", "--live", "--mode", "ect", "--platform", platform, "--mix",
                             mix, "--duration", "1s", "--quiet"});
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_EQ(outcome.err, "pirt: unit gpu: no such thing\n");
}

TEST(Messages, SayWhatIsWrongWithAMap) {
  const Scratch scratch;
  const auto map = scratch.write("m.yaml",
                                 "image: m.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n"
                                 "occupied_thresh: 0.65\nfree_thresh: 0.196\nnegate: 0\n");
  const auto refused = [&](const std::string& picture) {
    scratch.write("m.pgm", picture);
    const auto outcome = pirt({"plan", "--map", map, "--start", "0,0", "--goal", "0.1,0"});
    expect_refused(outcome, {"m.pgm' as a map", "export it as 8-bit grey PGM or PNG"});
    EXPECT_THAT(outcome.err, Not(HasSubstr("JPEG picture")));
    return outcome.err;
  };
  EXPECT_THAT(refused(""), HasSubstr("it is empty"));
  EXPECT_THAT(refused("P6\n1 1\n255\nabc"), HasSubstr("P6"));
  EXPECT_THAT(refused("GIF89a"), HasSubstr("neither"));
}

TEST(Messages, KeepWhatALibraryPrintsToThemselves) {
  const Scratch scratch;
  const auto config = scratch.write(
      "n.cfg",
      "[net]\nwidth=32\nheight=32\nchannels=3\n\n[convolutional]\nfilters=18\nsize=3\nstride=1\n"
      "pad=0\nactivation=linear\n\n[yolo]\nmask=0,1,2\nanchors=4,4,8,8,16,16\nclasses=1\nnum=3\n");
  std::string weights(20 + (18 + 18 * 3 * 9) * sizeof(float), '\0');
  weights[4] = 2;  // version 0.2, whose header has 20 bytes
  const auto model = scratch.write("n.weights", weights);
  const auto picture = std::string(kSourceFolder) + "/reports/report-dark.png";
  const std::vector<std::string> detector = {"describe", picture,    "--model",
                                             model,      "--config", config};
  ASSERT_EQ(pirt(detector).exit_code, 0) << pirt(detector).err;
  auto small = detector;
  small.insert(small.end(), {"--size", "1x1"});
  const auto outcome = pirt(small);
  expect_refused(outcome, {"n.weights", "1x1"});
  EXPECT_THAT(outcome.err, Not(HasSubstr("OPENCV")));
}

TEST(Messages, SayThatASeedChangesNothing) {
  const Scratch scratch;
  const auto mix = scratch.write("m.yaml", kMix);
  const auto with = [&](const std::string& ms, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"schedule",
                                          "--mode",
                                          "ect",
                                          "--mix",
                                          mix,
                                          "--platform",
                                          scratch.write("b.yaml", board("", ms))};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return pirt(arguments);
  };
  const auto idle = with("1", {"--seed", "7"});
  EXPECT_EQ(idle.exit_code, 0);
  EXPECT_THAT(idle.err, HasSubstr("--seed changes nothing"));
  EXPECT_THAT(with("1", {"--seed", "7", "--faults", "fail=0.1"}).err,
              HasSubstr("--faults has a seed of its own"));
  EXPECT_THAT(with("1", {}).err, Not(HasSubstr("--seed")));
  EXPECT_THAT(with("{uniform: [1, 2]}", {"--seed", "7"}).err, Not(HasSubstr("--seed")));
}

TEST(Messages, OfUncertainRowsMeasureTheSameAgain) {
  const Scratch scratch;
  const auto platform = scratch.write("b.yaml", board("process_factors: [1, 5]"));
  const std::string picture = std::string(kSourceFolder) + "/reports/report-dark.png";
  const auto outcome = pirt({"characterize", "--quick", "--platform", platform, "--set",
                             "gpu.active_w=2", "--filter", "^sobel$", "--images", picture, "--seed",
                             "7", "--db", scratch.file("p.db")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto uncertain = outcome.out.find("rows are uncertain");
  ASSERT_NE(uncertain, std::string::npos) << outcome.out;
  EXPECT_THAT(outcome.out.substr(uncertain),
              AllOf(HasSubstr("pirt characterize --platform " + platform + " --set"),
                    HasSubstr("gpu.active_w=2"), HasSubstr("--filter '^(sobel)$'"),
                    HasSubstr("--images " + picture), HasSubstr("--seed 7 --db "),
                    Not(HasSubstr("--quick"))));
}

/// Characterizes sobel on a unit of this script, whose set-ups are all good.
Outcome characterize_scripted(const std::string& script, const std::vector<std::string>& more) {
  const Scratch scratch;
  std::vector<std::string> arguments = {
      "characterize",
      "--quick",
      "--platform",
      scratch.write("f.yaml",
                    "platform: f\nunits: {gpu: {backend: fake, script: {" + script + "}}}\n"),
      "--filter",
      "^sobel$",
      "--db",
      scratch.file("p.db")};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return pirt(arguments);
}

TEST(Messages, SetUpsAloneAreNothingThatWasMeasured) {
  const auto outcome = characterize_scripted("wrong_output: [sobel]", {});
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err, HasSubstr("nothing was measured: sobel (gpu): wrong_output"));
}

TEST(Messages, StrictAsksForACallThatIsFreeOfDoubt) {
  const std::string apart = "process_factors: [1, 5], stages: {sobel: [{name: execute, ms: 1}]}";
  EXPECT_EQ(characterize_scripted(apart, {}).exit_code, 0);
  const auto strict = characterize_scripted(apart, {"--strict"});
  EXPECT_EQ(strict.exit_code, 3);
  EXPECT_THAT(strict.err, HasSubstr("no row of a call is free of doubt"));
}

TEST(Messages, SayWhereNoUnitSuspendsCalls) {
  const Scratch scratch;
  const auto mix = scratch.write("m.yaml", kMix);
  const auto with = [&](const std::string& slots) {
    return pirt(
        {"schedule", "--mode", "edf", "--slices", "on", "--mix", mix, "--platform",
         scratch.write("b.yaml", "platform: board\nunits:\n  gpu: {servers: 1, slots: " + slots +
                                     ", active_w: 1}\nworkloads:\n  sobel: {gpu: 1}\n")});
  };
  EXPECT_THAT(with("2").err, HasSubstr("--slices on changes nothing"));
  EXPECT_THAT(with("1").err, Not(HasSubstr("--slices")));
}

TEST(Messages, OfAnOlderTraceSayTheRemedyAndNoLibrarysWords) {
  const Scratch scratch;
  const std::string older = R"({"traceEvents": [], "pirt": {"mode": "ect", "log": []}})";
  const std::string other =
      R"({"traceEvents": [], "pirt": {"schema_version": 2, "mode": "ect", "log": []}})";
  for (const auto& text : {older, other, older.substr(0, 30)}) {
    const auto outcome = pirt({"replay", scratch.write("t.json", text)});
    expect_refused(outcome, {"t.json", "write it again with this one"});
    EXPECT_THAT(outcome.err, Not(HasSubstr("json.exception")));
  }
}

TEST(Quiet, LeavesErrorsAlone) {
  const Scratch scratch;
  const auto mix = scratch.write("m.yaml", kMix);
  const auto platform = scratch.write("b.yaml", board(""));
  const std::vector<std::string> live = {"schedule", "--live", "--mode", "ect",        "--platform",
                                         platform,   "--mix",  mix,      "--duration", "300ms"};
  auto quiet = live;
  quiet.emplace_back("--quiet");
  EXPECT_THAT(pirt(live).err, HasSubstr("gpu is ready"));
  const auto outcome = pirt(quiet);
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.err, "");
  EXPECT_NE(outcome.out, "");
  expect_refused(pirt({"schedule", "-q", "--mode", "ect", "--platform", "none.yaml"}),
                 {"none.yaml"});
}

TEST(Help, SaysTheRangesThatAreChecked) {
  const auto says = [](std::vector<std::string> command, const std::string& line) {
    command.emplace_back("--help");
    EXPECT_THAT(std::regex_replace(pirt(command).out, std::regex("\\s+"), " "), HasSubstr(line))
        << command.front();
  };
  says({"generate"}, "Frames a second [1 to 1000]");
  says({"bundle-adjust"}, "At most so many [1 to 100000]");
  says({"generate", "dag"}, "Number of tasks [1 to 10000]");
  says({"doctor"}, "[1e-06 to 3600]");
  EXPECT_THAT(pirt({"generate", "--help"}).out, Not(HasSubstr("9223372036854775807")));
}

TEST(Commands, RunOneAtATime) {
  expect_refused(pirt({"list", "modes", "doctor"}), {"unexpected argument 'doctor'"});
  expect_refused(pirt({"generate", "dag", "bal"}),
                 {"unexpected argument 'bal'", "'pirt generate dag --help'"});
  expect_refused(pirt({"generate", "dag", "schedule"}), {"unexpected argument 'schedule'"});
  // The name of a file that is called like a command.
  expect_refused(pirt({"replay", "report"}), {"'report'"});
}

TEST(Kinds, OfACommandHaveOptionsOfTheirOwn) {
  const Scratch scratch;
  EXPECT_EQ(pirt({"generate", "dag", "--tasks", "3", "-o", scratch.file("d.yaml")}).exit_code, 0);
  expect_refused(pirt({"generate", "--seed", "3", "dag"}), {"'--seed' before 'dag'"});
  expect_refused(pirt({"generate", scratch.file("out"), "bal"}), {"'folder' before 'bal'"});
  expect_refused(pirt({"generate", "dag", "--images", "9"}),
                 {"unknown option '--images'", "'pirt generate dag --help'"});
  expect_refused(pirt({"generate", "dag", "more"}), {"'more'", "'pirt generate dag --help'"});
  expect_refused(pirt({"generate"}), {"name the folder", "dag, bal"});
  expect_refused(pirt({"generate-dag", "--tasks", "3"}), {"pirt generate dag"});
  expect_refused(pirt({"generate-bal"}), {"pirt generate bal"});
}

}  // namespace
}  // namespace pirt::test
