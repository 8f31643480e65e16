// What --json writes is what reports/schema/ says: each command's output against its file, which
// other tools may rely on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "tests/cli/program.h"
#include "tests/support/data.h"
#include "workloads/base/text/text.h"

namespace pirt::test {
namespace {

/// Validates pairs of a schema's name and a document.
std::string problems_of(const std::vector<std::pair<std::string, std::string>>& documents) {
  const Scratch scratch;
  const auto script = scratch.write("validate.py", R"(
import json, os, sys
from jsonschema import Draft202012Validator as Validator, RefResolver
for file, document in zip(sys.argv[1::2], sys.argv[2::2]):
    schema = json.load(open(file))
    Validator.check_schema(schema)
    # Some refer to others beside them.
    validator = Validator(schema, resolver=RefResolver('file://' + os.path.dirname(file) + '/', schema))
    for error in validator.iter_errors(json.load(open(document))):
        print(schema['title'], error.json_path, error.message[:300])
)");
  std::string command = "python3 -W ignore " + script;
  for (const auto& [schema, document] : documents) {
    command += " " + quoted(std::string(kSourceFolder) + "/reports/schema/" + schema + ".json") +
               " " + quoted(document);
  }
  const auto outcome = run(command);
  return outcome.out + outcome.err;
}

class Schema : public testing::Test {
 protected:
  void SetUp() override {
    if (run("python3 -c 'from jsonschema import Draft202012Validator'").exit_code != 0) {
      GTEST_SKIP() << "python3-jsonschema is not installed";
    }
  }
  /// Runs a command with --json, for validate().
  void add(const std::string& schema, std::vector<std::string> arguments, int exit_code = 0) {
    const auto file = scratch_.file(std::to_string(documents_.size()) + ".json");
    arguments.insert(arguments.end(), {"--json", file});
    const auto outcome = pirt(arguments);
    EXPECT_EQ(outcome.exit_code, exit_code) << arguments[0] << ": " << outcome.err;
    documents_.emplace_back(schema, file);
  }
  void validate() const { EXPECT_EQ(problems_of(documents_), ""); }

  const Scratch scratch_;
  std::vector<std::pair<std::string, std::string>> documents_;
};

/// A platform of fake units: no figure here is a machine's.
constexpr const char* kBoard = R"(
platform: board
units:
  cpu: {backend: fake, active_w: 1, script: {stages: {sobel: [{name: execute, ms: 1}]}}}
  gpu: {backend: fake, active_w: 2, script: {stages: {sobel: [{name: execute, ms: 2}]}}}
  cloud: {backend: fake, role: cloud, active_w: 1, script: {stages: {sobel: [{name: execute, ms: 1}]}}}
)";
constexpr const char* kLoop =
    "mix: loop\npipelines: {p: {closed_loop: {frames: 10}, tasks: [{workload: sobel}]}}\n";

TEST_F(Schema, OfListings) {
  for (const char* what :
       {"workloads", "backends", "units", "platforms", "mixes", "modes", "meters"}) {
    add(std::string("list-") + what, {"list", what});
  }
  validate();
}

TEST_F(Schema, OfSchedules) {
  const std::vector<std::string> board = {"--platform", "snapdragon820", "--mix",
                                          "convolution-1000"};
  const auto with = [&](std::vector<std::string> words) {
    words.insert(words.end(), board.begin(), board.end());
    return words;
  };
  for (const char* mode :
       {"throughput", "latency", "energy", "advanced", "heft", "edf", "budget"}) {
    add("schedule", with({"schedule", "--mode", mode}));
  }
  const auto mix = scratch_.write(
      "m.yaml",
      "mix: m\nimage_buffers: 2\npipelines:\n  p: {rate_hz: 500, deadline_ms: 5, expires_ms: 20, "
      "tasks: [{workload: convolution, image_input: true}]}\n");
  add("schedule", {"schedule", "--mode", "ect", "--platform", "snapdragon820", "--mix", mix,
                   "--duration", "1s", "--faults", "seed=1,fail=0.1"});
  add("schedule", {"schedule", "--mode", "budget", "--platform", "fake", "--duration", "2s",
                   "--power-cap", "3W", "--objective", "energy", "--min-rate", "0.1"});
  add("pareto", with({"schedule", "--pareto"}));
  const auto slow = scratch_.write("w.yaml",
                                   "mix: w\npipelines: {p: {rate_hz: 100, deadline_ms: 40, tasks: "
                                   "[{workload: convolution}]}}\n");
  add("what-if", {"what-if", "--platform", "snapdragon820", "--mix", slow, "--duration", "1s",
                  "--raise", "p.rate_hz", "--modes", "edf,budget,cpu-only"});
  add("compare", with({"schedule", "--compare", "latency,throughput"}));
  const auto trace = scratch_.file("t.json");
  ASSERT_EQ(pirt(with({"schedule", "--mode", "energy", "--trace", trace})).exit_code, 0);
  add("replay", {"replay", trace});
  validate();
}

TEST_F(Schema, OfProfiles) {
  const auto board = scratch_.write("board.yaml", kBoard);
  const auto database = scratch_.file("p.db");
  const std::vector<std::string> sobel = {"characterize", "--quick", "--platform", board,
                                          "--filter",     "^sobel$", "--db",       database};
  add("characterize", sobel);
  auto dry = sobel;
  dry.emplace_back("--dry-run");
  add("characterize-dry-run", dry);
  const auto mix = scratch_.write("loop.yaml", kLoop);
  add("report", {"report", database, "--platform", board, "--mix", mix});
  add("report", {"report", "profile", database, "--platform", board});
  add("report-compare", {"report", "compare", database, "--platform", board, "--mix", mix});
  add("report-setup", {"report", "setup", database, "--platform", board});
  add("report-offload", {"report", "offload", database, "--platform", board});
  add("report-paper", {"report", "paper"});
  add("report-paper", {"report", "paper", database, "--platform", board, "--mix", mix});
  const auto copy = scratch_.write("copy.db", slurp(database));
  add("diff", {"diff", database, copy});
  add("history", {"history", database, copy});
  add("regress", {"regress", database, copy, "--mix", "none"});
  add("regress", {"regress", database, copy, "--mix", "none", "--anchor", database});
  add("regress-commands", {"regress", "--baseline-command", "echo time 1 s", "--candidate-command",
                           "echo time 1 s", "--reads", "lines", "--ledger", scratch_.file("l")});
  add("regress", {"regress", database, copy, "--mix", mix, "--platform", board});
  // Modes without a cost, and costs without energy.
  const auto other = scratch_.write("other.yaml",
                                    "mix: other\npipelines: {p: {closed_loop: {frames: 10}, tasks: "
                                    "[{workload: fc8}]}}\n");
  add("regress", {"regress", database, copy, "--mix", other, "--platform", board});
  const auto plain = scratch_.write(
      "plain.yaml",
      "platform: board\nunits: {cpu: {backend: fake}, gpu: {backend: fake}, cloud: {backend: fake, "
      "role: cloud}}\n");
  add("regress", {"regress", database, copy, "--mix", mix, "--platform", plain});
  // What ran live beside what was predicted of it, and a second profile.
  std::vector<std::string> files = {"report", database, copy};
  for (const bool live : {true, false}) {
    std::vector<std::string> run = {"schedule",   "--mode", "ect",   "--profile", database,
                                    "--platform", board,    "--mix", mix};
    if (live) run.emplace_back("--live");
    add("schedule", run);
    files.push_back(documents_.back().second);
  }
  files.insert(files.end(), {"--platform", board, "--mix", mix});
  add("report", files);
  EXPECT_THAT(slurp(documents_.back().second),
              testing::AllOf(testing::HasSubstr("\"others\""), testing::HasSubstr("\"live\"")));
  const auto file = scratch_.file("export.json");
  ASSERT_EQ(pirt({"export", database, "--format", "json", "-o", file}).exit_code, 0);
  documents_.emplace_back("export", file);
  const auto table = scratch_.write(
      "t.csv", "readme_version,soc,unit,threads,network,avg_ms\n2018,Acme 1,CPU,4,alexnet,20\n");
  add("import", {"import", table, "--db", scratch_.file("i.db")});
  validate();
}

TEST_F(Schema, OfTheRobot) {
  ASSERT_EQ(pirt({"generate", "--duration", "1s", "--width", "160", "--height", "120", "--rate",
                  "10", scratch_.file("room")})
                .exit_code,
            0);
  add("run-robot", {"run-robot", scratch_.file("room"), "--serial", "--fast", "--localize-only"});
  add("run-robot-compare", {"run-robot", scratch_.file("room"), "--fast", "--localize-only",
                            "--platform", "fake", "--compare", "ect"});
  add("plan", {"plan", "--map", scratch_.file("room") + "/map.yaml", "--start", "0,0", "--goal",
               "0.5,0.5"});
  const auto problem = scratch_.file("p.txt");
  ASSERT_EQ(pirt({"generate", "bal", "-o", problem}).exit_code, 0);
  add("bundle-adjust", {"bundle-adjust", problem});
  validate();
}

TEST_F(Schema, OfTheDoctor) {
  const auto file = scratch_.file("d.json");
  const auto outcome =
      pirt({"doctor", "--platform", "host-cpu", "--seconds", "0.01", "--json", file});
  EXPECT_THAT(outcome.exit_code, testing::AnyOf(0, 1)) << outcome.err;
  documents_.emplace_back("doctor", file);
  validate();
}

TEST_F(Schema, OfTuning) {
  const std::vector<std::string> tune = {"tune",     "--platform", "host-opencl",
                                         "--filter", "blur",       "--max-time",
                                         "2min",     "--output",   scratch_.file("tuning.json")};
  auto dry = tune;
  dry.emplace_back("--dry-run");
  if (pirt(dry).exit_code == 4) GTEST_SKIP() << "skipped: no OpenCL device";
  add("tune-dry-run", dry);
  add("tune", tune);
  validate();
}

TEST_F(Schema, OfTwoPrograms) {
  const auto program = scratch_.write(
      "program",
      "#!/bin/sh\ncase \"$*\" in *--help*) echo --workload; exit 0;; esac\n"
      R"(echo '{"pirt_sample": 1, "version": "1", "device": "CPU", "inputs": "a", "right": true, )"
      R"("detail": "", "seconds": {"call": 0.01}}')"
      "\n");
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  add("regress-programs",
      {"regress", "--baseline-program", program, "--candidate-program", program, "--filter",
       "sobel", "--platform", "fake", "--units", "cpu", "--ledger", scratch_.file("ledger")});
  validate();
}

TEST_F(Schema, OfDescriptions) {
  PIRT_DATA_OR_SKIP(photos, "photos-darknet");
  PIRT_DATA_OR_SKIP(yolo, "yolo-fastest-1.1");
  PIRT_DATA_OR_SKIP(squeezenet, "squeezenet-v1.0-deepcompressed");
  const auto outcome =
      pirt({"describe", "--model", yolo / "yolo-fastest-1.1.weights", "--config",
            yolo / "yolo-fastest-1.1.cfg", "--names", yolo / "coco.names", "--classifier",
            squeezenet / "squeezenet_v1.0_dc.caffemodel", "--classifier-config",
            squeezenet / "SqueezeNet_deploy.prototxt", "--classifier-names",
            squeezenet / "imagenet1000_wnid_name.txt", photos});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::istringstream lines(outcome.out);
  for (std::string line; std::getline(lines, line);) {
    const auto name = std::to_string(documents_.size()) + ".json";
    documents_.emplace_back("describe", scratch_.write(name, line));
  }
  EXPECT_GE(documents_.size(), 2U);
  validate();
}

// A command whose output no schema says would be an interface that nobody promises.
TEST(SchemaFiles, AreThereForEveryCommandWithJson) {
  std::size_t found = 0;
  for (const auto& command : split(pirt({"complete", "--", ""}).out, '\n')) {
    const auto name = command.substr(0, command.find('\t'));
    if (name.empty() || name.starts_with(':') || name.starts_with('-')) continue;
    if (pirt({"complete", "--", name, "--json"}).out.find("--json") == std::string::npos) continue;
    ++found;
    const auto folder = std::string(kSourceFolder) + "/reports/schema/";
    const auto file = name == "list" ? "list-units" : name;
    EXPECT_TRUE(std::filesystem::exists(folder + file + ".json")) << name;
  }
  EXPECT_GT(found, 10U);
}

// A file that no output was held against would say what nobody has seen.
TEST(SchemaFiles, AreAllTested) {
  const std::string test = slurp(std::string(kSourceFolder) + "/tests/cli/schema_test.cpp");
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(kSourceFolder) + "/reports/schema")) {
    const auto name = entry.path().stem().string();
    if (name == "profile") continue;  // what others refer to
    const bool listing = name.starts_with("list-");
    EXPECT_NE(test.find('"' + (listing ? name.substr(5) : name) + '"'), std::string::npos) << name;
  }
}

}  // namespace
}  // namespace pirt::test
