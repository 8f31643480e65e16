// Bad input of each kind: exit 2, one clear message with the remedy, nothing written.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

TEST(BadInput, UnknownCommandNamesTheNearest) {
  expect_refused(pirt({"shedule"}), {"unknown command 'shedule'", "schedule"});
}

TEST(BadInput, UnknownOptionNamesTheNearest) {
  expect_refused(pirt({"schedule", "--mod", "latency"}), {"unknown option '--mod'", "--mode"});
}

TEST(BadInput, UnknownModeNamesTheNearest) {
  expect_refused(pirt({"schedule", "--mode", "latncy", "--platform", "fake"}),
                 {"'latncy'", "latency"});
}

TEST(BadInput, UnknownWorkloadInFilterNamesTheNearest) {
  const Scratch scratch;
  expect_refused(pirt({"characterize", "--platform", "fake", "--filter", "soebl", "--db",
                       scratch.file("p.db")}),
                 {"soebl", "sobel"});
  EXPECT_FALSE(std::filesystem::exists(scratch.file("p.db")));
}

TEST(BadInput, BrokenRegexIsExplained) {
  const Scratch scratch;
  expect_refused(
      pirt({"characterize", "--platform", "fake", "--filter", "(", "--db", scratch.file("p.db")}),
      {"'('"});
}

TEST(BadInput, UnknownUnitNamesTheNearest) {
  const Scratch scratch;
  expect_refused(
      pirt({"characterize", "--platform", "fake", "--units", "gpuu", "--db", scratch.file("p.db")}),
      {"gpuu", "gpu"});
}

TEST(BadInput, UnknownPlatformAndMixNameTheNearest) {
  expect_refused(pirt({"schedule", "--mode", "latency", "--platform", "hots"}), {"'hots'", "host"});
  expect_refused(
      pirt({"schedule", "--mode", "latency", "--platform", "fake", "--mix", "full-robt"}),
      {"'full-robt'", "full-robot"});
}

TEST(BadInput, OptionsThatWouldMeanNothingAreRefused) {
  expect_refused(pirt({"list", "mixes", "--platform", "/nonexistent"}), {"--platform", "mixes"});
  expect_refused(pirt({"schedule", "--mode", "met", "--platform", "snapdragon820-section5", "--mix",
                       "section5", "--in-flight", "3"}),
                 {"--in-flight", "section5"});
}

class BadImages : public testing::Test {
 protected:
  Outcome characterize(const std::string& images) {
    const auto outcome = pirt({"characterize", "--platform", "fake", "--filter", "sobel",
                               "--images", images, "--db", scratch_.file("p.db")});
    EXPECT_FALSE(std::filesystem::exists(scratch_.file("p.db")));
    return outcome;
  }
  Scratch scratch_;
};

TEST_F(BadImages, MissingFolder) {
  expect_refused(characterize(scratch_.file("none")), {scratch_.file("none")});
}

TEST_F(BadImages, FolderWithoutImages) {
  std::filesystem::create_directory(scratch_.file("empty"));
  expect_refused(characterize(scratch_.file("empty")), {"PNG", scratch_.file("empty")});
}

TEST_F(BadImages, TextNamedPng) {
  std::filesystem::create_directory(scratch_.file("folder"));
  scratch_.write("folder/a.png", "this is not a picture\n");
  expect_refused(characterize(scratch_.file("folder")), {"a.png"});
}

TEST_F(BadImages, SingleFileThatIsNoImage) {
  expect_refused(characterize(scratch_.write("notes.txt", "hello\n")), {"notes.txt"});
}

TEST(BadYaml, SaysFileAndLine) {
  const Scratch scratch;
  const auto run = [&](const std::string& text) {
    return pirt({"schedule", "--mode", "latency", "--platform", "fake", "--mix",
                 scratch.write("m.yaml", text)});
  };
  expect_refused(run("mix: a\npipelins: {}\n"), {"m.yaml:2", "pipelins", "pipelines"});
  expect_refused(
      run("mix: a\npipelines:\n  p: {rate_hz: fast, tasks: [{name: t, workload: sobel}]}\n"),
      {"m.yaml:3", "rate_hz"});
  expect_refused(run("mix: [a\npipelines: {"), {"m.yaml:"});
  expect_refused(
      run("mix: a\npipelines:\n  p: {rate_hz: 1, tasks: [{name: t, workload: sobell}]}\n"),
      {"m.yaml:3", "sobell", "sobel"});
  expect_refused(run(""), {"m.yaml"});
}

constexpr const char* kMix =
    "mix: piped\npipelines: {p: {closed_loop: {frames: 1}, tasks: [{workload: sobel}]}}\n";

TEST(Inputs, APipeThatTheUserNamesIsRead) {
  const Scratch scratch;
  const auto mix = scratch.write("m.yaml", kMix);
  const std::string command =
      quoted(kProgram) + " schedule --mode met --platform fake --json - --mix ";
  for (const auto& script :
       {"cat " + quoted(mix) + " | " + command + "/dev/stdin",
        "mkfifo " + quoted(scratch.file("fifo")) + "; cat " + quoted(mix) + " >" +
            quoted(scratch.file("fifo")) + " & " + command + quoted(scratch.file("fifo"))}) {
    const auto outcome = run(script);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(outcome.json()["mix"], "piped");
  }
}

TEST(Inputs, WaitingForAPipeEndsBySignal) {
  const Scratch scratch;
  const auto outcome =
      run("mkfifo " + quoted(scratch.file("f")) + "; timeout -s TERM 1 " + quoted(kProgram) +
          " schedule --mode met --platform fake --mix " + quoted(scratch.file("f")));
  EXPECT_EQ(outcome.exit_code, 124) << outcome.err;  // as timeout(1) says it
}

TEST(Inputs, WithoutAnEndOrThatAreNoFilesAreRefused) {
  const Scratch scratch;
  std::filesystem::create_directory(scratch.file("folder.yaml"));
  scratch.write("long.yaml", "");
  std::filesystem::resize_file(scratch.file("long.yaml"), (std::uintmax_t{64} << 20) + 1);
  const std::vector<std::pair<std::string, std::string>> inputs = {
      {"/dev/zero", "device"},
      {scratch.file("folder.yaml"), "Is a directory"},
      {scratch.file("long.yaml"), "longer than the 64 MiB"}};
  for (const auto& [path, part] : inputs) {
    expect_refused(pirt({"schedule", "--mode", "met", "--platform", "fake", "--mix", path}),
                   {path, part});
    expect_refused(pirt({"schedule", "--mode", "met", "--platform", path}), {path, part});
    if (path != scratch.file("long.yaml")) {
      expect_refused(pirt({"replay", path}), {path, part});
    }
  }
}

TEST(Names, ThatATerminalWouldObeyAreShownAsEscapes) {
  expect_refused(pirt({"schedule", "--mode", "lat\x1b[2Jency\n", "--platform", "fake"}),
                 {"lat\\x1b[2Jency\\n"});
  expect_refused(pirt({"report", "none\x1b[2J\xff.db"}), {"none\\x1b[2J\\xff.db"});
  const Scratch scratch;
  const auto platform = scratch.write("p.yaml", "platform: p\nunits: {cpu: {servers: 1}}\n");
  expect_refused(pirt({"schedule", "--platform", platform, "--mix",
                       scratch.write("m.yaml", "mix: caf\xe9\npipelines: {}\n"), "--mode", "met",
                       "--trace", scratch.file("t.json")}),
                 {"m.yaml:1: not a text file", "\\xe9"});
  EXPECT_FALSE(std::filesystem::exists(scratch.file("t.json")));
}

TEST(Names, InARunOfOthersAreShownAsEscapes) {
  const Scratch scratch;
  const auto mix = scratch.write("m.yaml", kMix);
  auto run_json =
      pirt({"schedule", "--mode", "met", "--platform", "fake", "--mix", mix, "--json", "-"}).json();
  auto& units = run_json["units"];
  units["cpu\x1b[2J\nx"] = units["cpu"];
  units.erase("cpu");
  const auto made = pirt({"characterize", "--quick", "--platform", "fake", "--filter", "^pool5$",
                          "--db", scratch.file("p.db")});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto outcome = pirt(
      {"report", scratch.file("p.db"), "--mix", mix, scratch.write("run.json", run_json.dump())});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("cpu\\x1b[2J\\nx"));
  EXPECT_EQ(outcome.out.find('\x1b'), std::string::npos);
}

TEST_F(BadImages, FolderWithAPipeInIt) {
  std::filesystem::create_directory(scratch_.file("folder"));
  ASSERT_EQ(::mkfifo(scratch_.file("folder/a.png").c_str(), 0600), 0);
  expect_refused(characterize(scratch_.file("folder")), {"a.png", "not a regular file"});
}

class BadDatabase : public testing::Test {
 protected:
  void refused(const std::string& path, const std::vector<std::string>& parts) {
    expect_refused(pirt({"report", path}), parts);
    expect_refused(pirt({"schedule", "--mode", "latency", "--profile", path}), parts);
  }
  Scratch scratch_;
};

TEST_F(BadDatabase, Missing) {
  refused(scratch_.file("none.db"), {"none.db"});
  EXPECT_FALSE(std::filesystem::exists(scratch_.file("none.db")));
}

TEST_F(BadDatabase, Empty) { refused(scratch_.write("empty.db", ""), {"empty.db"}); }

TEST_F(BadDatabase, NotADatabase) {
  refused(scratch_.write("text.db", std::string(5000, 'x')), {"text.db", "not"});
}

class WithProfile : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scratch_ = std::make_unique<Scratch>();
    const auto made = pirt({"characterize", "--quick", "--platform", "fake", "--filter",
                            "sobel|fc8", "--db", scratch_->file("good.db")});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  static void TearDownTestSuite() { scratch_.reset(); }
  static std::string good() { return slurp(scratch_->file("good.db")); }
  static inline std::unique_ptr<Scratch> scratch_;
};

TEST_F(WithProfile, TruncatedDatabaseIsRefused) {
  const auto bytes = good();
  expect_refused(pirt({"report", scratch_->write("cut.db", bytes.substr(0, bytes.size() / 2))}),
                 {"cut.db"});
}

TEST_F(WithProfile, NewerDatabaseIsRefusedByVersion) {
  auto bytes = good();
  bytes[63] = static_cast<char>(99);  // user_version: big-endian at offset 60 of the SQLite header
  expect_refused(pirt({"report", scratch_->write("newer.db", bytes)}), {"newer.db", "99"});
}

TEST_F(WithProfile, CharacterizeLeavesADamagedDatabaseAsItWas) {
  const auto bytes = good().substr(0, 3000);
  const auto path = scratch_->write("damaged.db", bytes);
  expect_refused(
      pirt({"characterize", "--quick", "--platform", "fake", "--filter", "sobel", "--db", path}),
      {"damaged.db"});
  EXPECT_EQ(slurp(path), bytes);
}

TEST_F(WithProfile, UnwritableJsonTargetIsRefused) {
  const auto outcome =
      pirt({"report", scratch_->file("good.db"), "--json", "/nonexistent/folder/x.json"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("/nonexistent/folder/x.json"));
}

TEST_F(WithProfile, MixThatNeedsUnmeasuredWorkloadsSaysWhichCommandMeasuresThem) {
  const auto outcome = pirt({"schedule", "--mode", "latency", "--platform", "host", "--profile",
                             scratch_->file("good.db")});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("pirt characterize"));
}

TEST_F(WithProfile, DrawsServiceTimesFromItsRows) {
  const auto mix = scratch_->write(
      "one.yaml",
      "mix: one\npipelines: {p: {closed_loop: {frames: 200}, tasks: [{workload: sobel}]}}");
  const auto schedule = [&](const std::string& draw, const std::string& seed) {
    const auto outcome =
        pirt({"schedule", "--mode", "met", "--in-flight", "1", "--mix", mix, "--profile",
              scratch_->file("good.db"), "--draw", draw, "--seed", seed, "--json", "-"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome;
  };
  const auto drawn = schedule("samples", "1");
  EXPECT_EQ(drawn.json()["draw"], "samples");
  EXPECT_EQ(schedule("samples", "1").out, drawn.out);
  const auto other = schedule("samples", "2").json();
  EXPECT_EQ(other["completed"], 200);
  const auto median = schedule("median", "1").json();
  EXPECT_EQ(schedule("median", "2").json()["makespan_s"], median["makespan_s"]);
  EXPECT_GE(schedule("p95", "1").json()["makespan_s"], median["makespan_s"]);
}

TEST(FullDisk, IsAnErrorWithAMessageAndLeavesNothing) {
  const Scratch scratch;
  // 8 to 16 KiB a file (by shell), which ends a program by a signal unless it looks at the error;
  // too little for an empty database.
  const auto outcome = run("ulimit -f 16; " + quoted(kProgram) +
                           " characterize --quick --platform fake --filter '^pool5$' --db " +
                           quoted(scratch.file("p.db")));
  EXPECT_EQ(outcome.exit_code, 4) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("cannot make profile database"));
  EXPECT_FALSE(std::filesystem::exists(scratch.file("p.db")));
}

}  // namespace
}  // namespace pirt::test
