// pirt regress on stored profiles, through the program: exit codes and outputs.
#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

class Regress : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scratch_ = std::make_unique<Scratch>();
    measure("base.db", 2, 7);
    measure("same.db", 2, 7);
    measure("slow.db", 3, 7);
    measure("other.db", 2, 8);  // Another seed: other inputs.
  }
  static void TearDownTestSuite() { scratch_.reset(); }

  /// Two workloads on a simulated unit; sobel takes @p sobel_ms.
  static void measure(const std::string& name, int sobel_ms, int seed,
                      const std::string& filter = "sobel|fc8") {
    const auto platform = scratch_->write(
        "board.yaml",
        "platform: board\nunits: {cpu: {backend: fake, slots: 1, active_w: 2}}\nworkloads:\n"
        "  sobel: {cpu: [{on: cpu, ms: " +
            std::to_string(sobel_ms) +
            ", name: execute}]}\n"
            "  fc8: {cpu: [{on: cpu, ms: 5, name: execute}]}\n");
    const auto made = pirt({"characterize", "--quick", "--platform", platform, "--filter", filter,
                            "--seed", std::to_string(seed), "--db", scratch_->file(name)});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  static Outcome regress(const std::string& candidate, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {"regress", scratch_->file("base.db"),
                                          scratch_->file(candidate), "--mix", "none"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return pirt(arguments);
  }

  static inline std::unique_ptr<Scratch> scratch_;
};

TEST_F(Regress, IsQuietWhereNothingChanged) {
  const auto outcome = regress("same.db");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("no regression"), Not(HasSubstr("sobel"))));
  EXPECT_THAT(regress("same.db", {"--all"}).out, HasSubstr("sobel"));
}

TEST_F(Regress, FailsWhereSomethingBecameSlower) {
  const auto json = scratch_->file("r.json");
  const auto junit = scratch_->file("r.xml");
  const auto outcome = regress("slow.db", {"--markdown", "-", "--junit", junit, "--json", json});
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("REGRESSION"), HasSubstr("| sobel"),
                                 Not(HasSubstr("fc8")), HasSubstr("+50")));
  EXPECT_THAT(slurp(junit), HasSubstr("<failure"));
  const auto rows = nlohmann::json::parse(slurp(json))["rows"];
  int slower = 0;
  for (const auto& row : rows) {
    if (row["verdict"] != "slower") continue;
    EXPECT_EQ(row["workload"], "sobel");
    ++slower;
  }
  EXPECT_EQ(slower, 2) << "execute and call";
}

TEST_F(Regress, PutsComparableRunsOfAFileTogether) {
  std::filesystem::copy_file(scratch_->file("base.db"), scratch_->file("two.db"));
  measure("two.db", 2, 7);
  measure("two.db", 2, 7);
  EXPECT_THAT(regress("two.db", {"--all"}).out, HasSubstr("two.db (3 runs)"));
  // A run on other inputs stays out; being the newest, it is what counts.
  measure("two.db", 2, 8);
  EXPECT_THAT(regress("two.db", {"--all"}).out, Not(HasSubstr("runs)")));
}

// 3 ms of another text of the platform in the base would hide that 2 ms became 3.
TEST_F(Regress, PutsNothingTogetherThatIsOfAnotherPlatformText) {
  measure("mixed.db", 3, 7);
  measure("mixed.db", 2, 7);
  const auto outcome =
      pirt({"regress", scratch_->file("mixed.db"), scratch_->file("slow.db"), "--mix", "none"});
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("mixed.db (1 of another program, platform"), HasSubstr("+50")));
}

TEST_F(Regress, SaysThatRowsAreOfTwoPlatformTexts) {
  measure("parts.db", 3, 7);
  measure("parts.db", 2, 7, "^sobel$");
  const auto outcome = regress("parts.db");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("(rows of 2 programs or platforms)"));
}

// Its rows are those of the run before, perhaps of the program before.
TEST_F(Regress, ARunThatBrokeOffInItsFirstRoundIsNoPass) {
  measure("broken.db", 2, 7);
  const auto cut =
      pirt({"characterize", "--quick", "--platform", scratch_->file("board.yaml"), "--filter",
            "sobel|fc8", "--seed", "7", "--max-time", "1ns", "--db", scratch_->file("broken.db")});
  EXPECT_EQ(cut.exit_code, 4) << cut.err;
  const auto outcome = regress("broken.db");
  EXPECT_EQ(outcome.exit_code, 3) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("the candidate's run did not end"));
  measure("broken.db", 2, 7);
  EXPECT_EQ(regress("broken.db").exit_code, 0) << "it was measured since";
}

TEST_F(Regress, SaysWhatIsNotComparable) {
  const auto outcome = regress("other.db");
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("INCONCLUSIVE"), HasSubstr("seed")));
}

TEST_F(Regress, ComparesEachRowByItsOwnRun) {
  std::filesystem::copy_file(scratch_->file("base.db"), scratch_->file("seeds.db"));
  measure("seeds.db", 2, 8, "^sobel$");
  const auto outcome = pirt({"regress", scratch_->file("seeds.db"), scratch_->file("other.db"),
                             "--mix", "none", "--json", "-"});
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  const auto rows = outcome.json()["rows"];
  for (const auto& row : rows) {
    if (row["phase"] != "call") continue;
    const bool compared = row["workload"] == "sobel";
    EXPECT_EQ(row["verdict"], compared ? "same" : "not comparable") << row;
    if (!compared) {
      EXPECT_THAT(row["reason"].get<std::string>(), testing::StartsWith("seed: 7 against 8"));
    }
  }
}

TEST_F(Regress, RefusesBadInput) {
  expect_refused(regress("base.db"), {"same file"});
  expect_refused(regress("none.db"), {"none.db"});
  expect_refused(pirt({"regress", scratch_->file("base.db")}), {"BASELINE"});
  expect_refused(regress("same.db", {"--junit", "-", "--json", "-"}), {"--junit", "stdout"});
  expect_refused(regress("same.db", {"--filter", "soebl"}), {"soebl", "sobel"});
  const auto unwritable = regress("same.db", {"--junit", "/nonexistent/r.xml"});
  EXPECT_EQ(unwritable.exit_code, 2);
  EXPECT_THAT(unwritable.err, HasSubstr("/nonexistent/r.xml"));
}

TEST_F(Regress, ComparesWhatTheMixCosts) {
  const auto mix = scratch_->write("mix.yaml",
                                   "mix: two\npipelines: {p: {rate_hz: 20, deadline_ms: 7, tasks: "
                                   "[{workload: sobel}, {workload: fc8, after: [sobel]}]}}");
  const auto outcome = pirt({"regress", scratch_->file("base.db"), scratch_->file("slow.db"),
                             "--mix", mix, "--platform", scratch_->file("board.yaml")});
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("What mix two costs"));
  // Its platform is not shipped: judged all the same.
  const auto without =
      pirt({"regress", scratch_->file("base.db"), scratch_->file("slow.db"), "--mix", mix});
  EXPECT_EQ(without.exit_code, 1);
  EXPECT_THAT(without.err, HasSubstr("--platform"));
}

TEST_F(Regress, AnImportedBoardIsItsOwnPlatform) {
  const auto table = scratch_->write("t.csv",
                                     "soc,unit,threads,network,avg_ms\n"
                                     "Acme 1,CPU A57,4,alexnet,20\nAcme 1,GPU Quad,1,alexnet,10\n");
  const auto mix = scratch_->write("imported.yaml",
                                   "mix: m\npipelines: {see: {closed_loop: {frames: 10}, tasks: "
                                   "[{workload: ncnn.alexnet}]}}\n");
  for (const char* name : {"import.db", "again.db"}) {
    const auto made = pirt({"import", table, "--db", scratch_->file(name)});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  const auto outcome =
      pirt({"regress", scratch_->file("import.db"), scratch_->file("again.db"), "--mix", mix});
  EXPECT_THAT(outcome.err, Not(HasSubstr("what the mix costs is not shown")));
  EXPECT_THAT(outcome.out, HasSubstr("mix m"));
}

/// Nine workloads of a simulated board, measured as somebody would.
class RegressCases : public testing::Test {
 protected:
  static void SetUpTestSuite() { scratch_ = std::make_unique<Scratch>(); }
  static void TearDownTestSuite() { scratch_.reset(); }

  /// @param slower  Of all workloads.
  /// @param script  More lines of the unit's script.
  /// @param filter  Empty = all nine.
  static void measure(const std::string& name, double slower, const std::string& script,
                      const std::string& filter = "") {
    std::string text =
        "platform: cases\nunits:\n  cpu:\n    backend: fake\n    role: cpu\n    active_w: 1\n"
        "    script:\n      stages:\n";
    double ms = 1;
    for (const char* workload :
         {"gaussian_blur", "convolution", "sobel", "undistort", "feature_detect", "optical_flow",
          "extract_features", "track_features", "background_model"}) {
      text += "        " + std::string(workload) +
              ": [{name: execute, ms: " + std::to_string(ms * slower) + "}]\n";
      ms += 0.3;
    }
    const auto platform = scratch_->write(name + ".yaml", text + script);
    const auto made = pirt({"characterize", "--quick", "--platform", platform, "--filter",
                            filter.empty() ? kNine : filter, "--db", db(name)});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  static std::string db(const std::string& name) { return scratch_->file(name + ".db"); }
  static Outcome regress(const std::string& base, const std::string& candidate,
                         std::vector<std::string> more = {}) {
    more.insert(more.begin(), {"regress", db(base), db(candidate), "--mix", "none"});
    return pirt(more);
  }

  static constexpr const char* kNine =
      "^(gaussian_blur|convolution|sobel|undistort|feature_detect|optical_flow|extract_features|"
      "track_features|background_model)$";
  static constexpr const char* kFactors =
      "      process_factors: [1, 1.004, 0.997, 1.002, 0.999, 1.003, 0.998]\n";
  static inline std::unique_ptr<Scratch> scratch_;
};

TEST_F(RegressCases, LetNoRegressionThroughAndNoEqualOnesFail) {
  measure("base", 1, kFactors);
  measure("same", 1, kFactors);
  EXPECT_EQ(regress("base", "same").exit_code, 0);
  EXPECT_EQ(regress("base", "same", {"--strict"}).exit_code, 0)
      << "set-ups that are not judged block nothing";
  EXPECT_THAT(regress("base", "same").out, HasSubstr("of set-up)"));

  measure("all9", 1.09, kFactors);
  const auto all9 = regress("base", "all9");
  EXPECT_EQ(all9.exit_code, 3);
  EXPECT_THAT(all9.out, AllOf(ContainsRegex("all rows moved together, by (8.9|9.[01]) % or more"),
                              HasSubstr("Taken off as the machine's")));
  EXPECT_EQ(regress("base", "all9", {"--filter", "^sobel$"}).exit_code, 3)
      << "as without the filter";

  std::string samples;
  for (int i = 0; i < 200; ++i) {
    samples += std::string(i == 0 ? "" : ", ") + (i % 25 == 10 ? "40" : "1.6");
  }
  measure("tail", 1, "      samples_ms: {sobel: [" + samples + "]}\n" + kFactors, "^sobel$");
  const auto tail = regress("base", "tail", {"--filter", "^sobel$"});
  EXPECT_EQ(tail.exit_code, 1);
  EXPECT_THAT(tail.out, AllOf(HasSubstr("1 slower"), HasSubstr("call tail")));

  for (const char* how : {"wrong_output", "crash"}) {
    measure(how, 1, std::string("      ") + how + ": [sobel]\n" + kFactors,
            "^(sobel|convolution)$");
    const auto failed = regress("base", how, {"--filter", "^(sobel|convolution)$"});
    EXPECT_EQ(failed.exit_code, 1) << how;
    EXPECT_THAT(failed.out, HasSubstr("failed"));
  }
}

TEST_F(RegressCases, SmallStepsAddUpAgainstAnAnchor) {
  for (const auto& [name, slower] : {std::pair("creep0", 1.0), std::pair("creep2", 1.0455 * 1.0455),
                                     std::pair("creep3", 1.0455 * 1.0455 * 1.0455)}) {
    measure(name, 1,
            "      samples_ms: {sobel: [" + std::to_string(1.6 * slower) + "]}\n" + kFactors,
            "^sobel$");
  }
  EXPECT_EQ(regress("creep2", "creep3").exit_code, 0);
  const auto anchored = regress("creep2", "creep3", {"--anchor", db("creep0")});
  EXPECT_EQ(anchored.exit_code, 1);
  EXPECT_THAT(anchored.out, HasSubstr("call, against the anchor"));
  expect_refused(regress("creep2", "creep3", {"--anchor", db("creep3")}), {"same file"});
  expect_refused(pirt({"regress", "--baseline-program", "a", "--candidate-program", "b", "--anchor",
                       db("creep0")}),
                 {"--anchor", "profiles"});
}

}  // namespace
}  // namespace pirt::test
