// pirt report of databases and runs, as the program does it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class ReportOfRuns : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scratch_ = std::make_unique<Scratch>();
    const auto made = pirt({"characterize", "--quick", "--platform", "fake", "--filter",
                            "^convolution$", "--db", database()});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  static void TearDownTestSuite() { scratch_.reset(); }
  static std::string database() { return scratch_->file("p.db"); }

  /// The record of a run; @p more before its name.
  static std::string schedule(const std::string& name, std::vector<std::string> more) {
    const auto file = scratch_->file(name);
    std::vector<std::string> arguments = {"schedule", "--mode", "throughput", "--mix",
                                          kMix,       "--json", file};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto run = pirt(arguments);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return file;
  }

  static constexpr const char* kMix = "convolution-1000";
  static inline std::unique_ptr<Scratch> scratch_;
};

TEST_F(ReportOfRuns, PutsALiveRunBesideVirtualTime) {
  const auto live = schedule("live.json", {"--profile", database(), "--live"});
  const auto predicted = schedule("virtual.json", {"--profile", database()});
  const auto report =
      pirt({"report", database(), live, predicted, "--mix", kMix, "--json", scratch_->file("j")});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  EXPECT_THAT(report.out, AllOf(HasSubstr("Live beside virtual time"), HasSubstr("frames"),
                                HasSubstr("p95 ms"), HasSubstr("cold caches"),
                                HasSubstr("Rows of the profile that the live run contradicts")));
  EXPECT_THAT(report.out, Not(HasSubstr("There is no run in virtual time")));
  const auto json = nlohmann::ordered_json::parse(slurp(scratch_->file("j")));
  const auto& errors = json["live"][0]["predictions"][0];
  EXPECT_TRUE(errors["pipelines"]["frames"].contains("rate_hz_error"));
  EXPECT_TRUE(errors["units"]["cpu"].contains("utilization_error"));
  ASSERT_FALSE(json["live"][0]["rows"].empty());
  // Calls that were made are those that completed.
  std::int64_t calls = 0;
  for (const auto& row : json["live"][0]["rows"]) calls += row["calls"].get<std::int64_t>();
  EXPECT_EQ(calls, 1000);

  const auto alone = pirt({"report", database(), live, "--mix", kMix, "--format", "md"});
  ASSERT_EQ(alone.exit_code, 0) << alone.err;
  EXPECT_THAT(alone.out, HasSubstr("this makes it: pirt schedule --mode throughput"));
}

TEST_F(ReportOfRuns, RefusesARunOfAnotherSchemaVersion) {
  auto record =
      nlohmann::ordered_json::parse(slurp(schedule("run.json", {"--platform", "snapdragon820"})));
  record["schema_version"] = 7;
  const auto file = scratch_->write("seven.json", record.dump());
  const auto report = pirt({"report", database(), file});
  EXPECT_EQ(report.exit_code, 2);
  EXPECT_THAT(report.err,
              AllOf(HasSubstr(file), HasSubstr("schema_version 7"), HasSubstr("write it again")));
}

TEST_F(ReportOfRuns, AnswersForTheRunsThatAreGiven) {
  const auto given = schedule("given.json", {"--profile", database()});
  const auto report = pirt({"report", database(), given, "--mix", kMix, "--format", "md"});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  EXPECT_THAT(report.out, AllOf(HasSubstr("throughput keeps up"), Not(HasSubstr("Take "))));
}

TEST_F(ReportOfRuns, DrawsTheScheduleOfTheRunThatIsGiven) {
  const auto record = scratch_->file("budget.json");
  const auto run = pirt({"schedule", "--mode", "budget", "--objective", "energy", "--min-rate",
                         "0.001", "--profile", database(), "--mix", kMix, "--json", record});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto page = scratch_->file("budget.html");
  const auto report = pirt({"report", "page", database(), record, "--mix", kMix, "-o", page});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  EXPECT_THAT(slurp(page), AllOf(HasSubstr("--seed 1 --in-flight "),
                                 HasSubstr(" --objective energy --min-rate 0.001 --trace")));
}

TEST_F(ReportOfRuns, DrawsNoScheduleOfARunOfAnotherMachine) {
  const auto page = scratch_->file("without.html");
  const auto record = schedule("without.json", {"--profile", database(), "--without", "gpu"});
  const auto report = pirt({"report", "page", database(), record, "--mix", kMix, "-o", page});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  EXPECT_THAT(slurp(page), Not(HasSubstr("the whole of it: pirt")));
}

TEST_F(ReportOfRuns, SaysWhatMakesItsScheduleAgainInAnyFolder) {
  scratch_->write("mine.yaml",
                  "mix: mine\npipelines:\n"
                  "  p: {closed_loop: {frames: 3}, tasks: [{workload: convolution}]}\n");
  scratch_->write("fake.yaml",
                  slurp(std::string(kSourceFolder) + "/characterize/platform/platforms/fake.yaml"));
  const auto report = run("cd " + quoted(scratch_->file(".")) + " && " + quoted(kProgram) +
                          " report page p.db --platform ./fake.yaml --mix ./mine.yaml --set "
                          "cpu.active_w=15 --strict -o mine.html");
  ASSERT_EQ(report.exit_code, 0) << report.err;
  const std::string page = slurp(scratch_->file("mine.html"));
  const std::string before = "the whole of it: pirt ";
  const auto begin = page.find(before);
  ASSERT_NE(begin, std::string::npos);
  const auto from = begin + before.size();
  const std::string arguments = page.substr(from, page.find("</p>", from) - from);
  EXPECT_THAT(arguments, AllOf(HasSubstr(" --set cpu.active_w=15 "), HasSubstr(" --strict ")));
  const Scratch elsewhere;
  const auto again =
      run("cd " + quoted(elsewhere.file(".")) + " && " + quoted(kProgram) + " " + arguments);
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_TRUE(std::filesystem::exists(elsewhere.file("trace.json")));
}

TEST_F(ReportOfRuns, APlatformIsTheFirstDatabasesAlone) {
  const auto board =
      scratch_->write("board.yaml",
                      "platform: board\nunits: {fpga: {backend: fake, slots: 1, active_w: 1}}\n"
                      "workloads: {convolution: {fpga: [{on: fpga, ms: 1, name: execute}]}}\n");
  const auto other = scratch_->file("board.db");
  const auto made = pirt(
      {"characterize", "--quick", "--platform", board, "--filter", "^convolution$", "--db", other});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto report = pirt({"report", "text", database(), other, "--platform", "fake", "--set",
                            "dsp.active_w=1", "--mix", kMix});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  EXPECT_THAT(report.out, AllOf(HasSubstr("fpga"), HasSubstr("dsp")));
}

TEST_F(ReportOfRuns, ShowsHowSamplesOfEveryDatabaseAreSpread) {
  const auto copy = scratch_->file("copy.db");
  std::filesystem::copy_file(database(), copy);
  const auto report = pirt({"report", "profile", database(), copy});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  const std::string title = "How samples of a call are spread";
  const auto table = [&](std::size_t begin) {
    return report.out.substr(begin, report.out.find("narrow is steady", begin) - begin);
  };
  const auto first = report.out.find(title), last = report.out.rfind(title);
  ASSERT_NE(first, last);
  EXPECT_EQ(table(first), table(last));
}

TEST_F(ReportOfRuns, NeedsMoreThanATrace) {
  const auto trace = scratch_->file("trace.json");
  schedule("traced.json", {"--platform", "snapdragon820", "--trace", trace});
  expect_refused(pirt({"report", "page", trace, "-o", scratch_->file("r.html")}),
                 {"traces alone make no report", "--platform"});
}

TEST_F(ReportOfRuns, RefusesSettingsThatItCannotTake) {
  const auto record = schedule("plain.json", {"--platform", "snapdragon820"});
  const std::vector<std::vector<std::string>> documents = {
      {"text", database()},    {"page", database()},  {"compare", database()},
      {"paper", database()},   {"setup", database()}, {"offload", database()},
      {"profile", database()}, {"text", record},      {"paper"}};
  for (const auto& document : documents) {
    SCOPED_TRACE(testing::PrintToString(document));
    std::vector<std::string> words = {"report"};
    words.insert(words.end(), document.begin(), document.end());
    words.insert(words.end(), {"--set", "garbage"});
    expect_refused(pirt(words), {"'garbage'"});
  }
}

TEST_F(ReportOfRuns, RefusesAPlatformWhereItReadsNoDatabase) {
  const auto record = schedule("alone.json", {"--platform", "snapdragon820"});
  expect_refused(pirt({"report", "text", record, "--platform", "nosuch"}), {"--platform 'nosuch'"});
  expect_refused(pirt({"report", "paper", "--platform", "nosuch"}), {"--platform 'nosuch'"});
}

TEST_F(ReportOfRuns, SaysThatAFurtherDatabaseIsNotThere) {
  expect_refused(pirt({"report", "paper", database(), scratch_->file("dps.db")}),
                 {"there is no profile database", "dps.db"});
}

TEST_F(ReportOfRuns, IsAPageOnlyWhereThatIsAskedFor) {
  expect_refused(pirt({"report", "text", database(), "--format", "html"}), {"pirt report page"});
  expect_refused(pirt({"report", "text", database(), "--format", "json"}), {"--json FILE"});
}

TEST_F(ReportOfRuns, KnowsARunWhateverItsFileBeginsWith) {
  const auto record = schedule("plain.json", {"--platform", "snapdragon820"});
  const auto marked = scratch_->write("marked.json", "\xef\xbb\xbf\n" + slurp(record));
  const auto report = pirt({"report", "text", marked, "--mix", kMix});
  EXPECT_EQ(report.exit_code, 0) << report.err;
}

TEST_F(ReportOfRuns, SaysWhereItCannotWrite) {
  const auto file = scratch_->file("missing/report.html");
  const auto report = pirt({"report", "page", database(), "-o", file});
  EXPECT_EQ(report.exit_code, 2);
  EXPECT_THAT(report.err, AllOf(HasSubstr(file), HasSubstr("No such file or directory")));
}

TEST_F(ReportOfRuns, AnswersFirst) {
  const auto report = pirt({"report", database()});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  std::istringstream lines(report.out);
  std::vector<std::string> text;
  for (std::string line; std::getline(lines, line);) text.push_back(line);
  const auto first = [&](const std::string& part) {
    return std::ranges::find_if(
               text, [&](const auto& each) { return each.find(part) != std::string::npos; }) -
           text.begin();
  };
  EXPECT_LT(first("Preferable unit for each workload"), 40);
  EXPECT_LT(first("Preferable unit for each workload"), first("Time and energy"));
  // Of three rows, with sixteen modes.
  EXPECT_LT(text.size(), 260U);
  EXPECT_THAT(report.out, Not(HasSubstr("The paper's claims")));
  EXPECT_FALSE(pirt({"report", database(), "--json", "-"}).json().contains("scorecard"));
}

TEST_F(ReportOfRuns, OfThePaperHasSectionFiveInEachForm) {
  for (const char* format : {"text", "md", "html"}) {
    const auto report = pirt({"report", "paper", "--format", format});
    ASSERT_EQ(report.exit_code, 0) << report.err;
    EXPECT_THAT(report.out, AllOf(HasSubstr("Section V of the Pi-RT paper, in virtual time"),
                                  HasSubstr("25.0 localizations a second, in throughput mode")))
        << format;
  }
  const auto json = pirt({"report", "paper", "--json", "-"}).json();
  EXPECT_EQ(json["section5"]["paper_with"]["power_w"], 11);
}

}  // namespace
}  // namespace pirt::test
