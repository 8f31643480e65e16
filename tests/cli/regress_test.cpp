// pirt regress on stored profiles, through the program: exit codes and outputs.
#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
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
  static void measure(const std::string& name, int sobel_ms, int seed) {
    const auto platform = scratch_->write(
        "board.yaml",
        "platform: board\nunits: {cpu: {backend: fake, slots: 1, active_w: 2}}\nworkloads:\n"
        "  sobel: {cpu: [{on: cpu, ms: " +
            std::to_string(sobel_ms) +
            ", name: execute}]}\n"
            "  fc8: {cpu: [{on: cpu, ms: 5, name: execute}]}\n");
    const auto made =
        pirt({"characterize", "--quick", "--platform", platform, "--filter", "sobel|fc8", "--seed",
              std::to_string(seed), "--db", scratch_->file(name)});
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
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("mixed.db (1 of another program or platform file"),
                                 HasSubstr("+50")));
}

TEST_F(Regress, SaysWhatIsNotComparable) {
  const auto outcome = regress("other.db");
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("INCONCLUSIVE"), HasSubstr("seed")));
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

}  // namespace
}  // namespace pirt::test
