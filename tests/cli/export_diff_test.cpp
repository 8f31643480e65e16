// pirt export and pirt diff as their users run them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

class ExportDiff : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scratch_ = std::make_unique<Scratch>();
    // The second seed draws other times; the third file has no cell in common with the others.
    characterize("a.db", "^(sobel|fc8)$", "cpu", "1");
    characterize("b.db", "^fc8$", "cpu,gpu", "2");
    characterize("c.db", "^pool5$", "cpu", "1");
  }
  static void TearDownTestSuite() { scratch_.reset(); }
  static void characterize(const std::string& name, const std::string& filter,
                           const std::string& units, const std::string& seed) {
    const auto made = pirt({"characterize", "--quick", "--platform", "fake", "--filter", filter,
                            "--units", units, "--seed", seed, "--db", file(name)});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  static std::string file(const std::string& name) { return scratch_->file(name); }
  static void expect_refused(const Outcome& outcome, const std::string& part) {
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_EQ(outcome.out, "");
    EXPECT_THAT(outcome.err, AllOf(StartsWith("pirt: "), HasSubstr(part)));
  }
  static inline std::unique_ptr<Scratch> scratch_;
};

TEST_F(ExportDiff, EveryFormatNamesTheSameFigures) {
  const auto json = pirt({"export", file("a.db"), "--format", "json"}).json();
  EXPECT_EQ(json["schema_version"], 1);
  std::int64_t median = 0;
  for (const auto& row : json["profile_summary"]) {
    EXPECT_EQ(row["samples_ns"].size(), row["samples"]);
    if (row["workload"] == "fc8" && row["phase"] == "call") median = row["median_ns"];
  }
  EXPECT_GT(median, 0);
  const auto csv = pirt({"export", file("a.db"), "--format", "csv", "--filter", "fc8"});
  EXPECT_THAT(csv.out, AllOf(StartsWith("run_id,platform,workload,"),
                             HasSubstr("," + std::to_string(median) + ",")));
  const auto gbench = pirt({"export", file("a.db"), "--format", "gbench"}).json();
  bool found = false;
  for (const auto& entry : gbench["benchmarks"]) {
    if (entry["name"] != "fc8/cpu/call/real_time_median") continue;
    found = true;
    EXPECT_EQ(entry["real_time"], median);
    EXPECT_EQ(entry["provenance"], "modelled");  // fake units have simulated clocks
  }
  EXPECT_TRUE(found);
}

TEST_F(ExportDiff, ExportWritesAWholeFileOrNone) {
  const auto target = file("out.csv");
  const auto outcome = pirt({"export", file("a.db"), "--format", "csv", "-o", target});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(slurp(target), pirt({"export", file("a.db"), "--format", "csv", "-o", "-"}).out);
  expect_refused(pirt({"export", file("a.db"), "--format", "csv", "-o", file("none/x.csv")}),
                 "none");
  // A bad export leaves what was there before.
  expect_refused(pirt({"export", file("none.db"), "--format", "csv", "-o", target}),
                 "no profile database");
  EXPECT_THAT(slurp(target), StartsWith("run_id,"));
}

TEST_F(ExportDiff, ExportExplainsBadInput) {
  expect_refused(pirt({"export", file("a.db")}), "--format is required");
  expect_refused(pirt({"export", file("a.db"), "--format", "jsn"}), "json");
  expect_refused(pirt({"export", "--format", "json"}), "no profile database given");
  expect_refused(pirt({"export", file("a.db"), "--format", "json", "--table", "energy"}),
                 "csv only");
  expect_refused(pirt({"export", file("a.db"), "--format", "csv", "--table", "enrgy"}), "energy");
  expect_refused(pirt({"export", file("a.db"), "--format", "csv", "--filter", "soebl"}), "sobel");
  expect_refused(pirt({"export", file("a.db"), "--format", "csv", "--platform", "host"}), "'host'");
  expect_refused(
      pirt({"export", scratch_->write("text", "no database, by no means"), "--format", "json"}),
      "not a profile database");
}

TEST_F(ExportDiff, DiffShowsIdentityThenFigures) {
  const auto text = pirt({"diff", file("a.db"), file("b.db")});
  ASSERT_EQ(text.exit_code, 0) << text.err;
  EXPECT_LT(text.out.find("Identity differs"), text.out.find("Figures side by side"));
  EXPECT_THAT(text.out,
              AllOf(HasSubstr("seed"), HasSubstr("Only in a: sobel on cpu"),
                    HasSubstr("Only in b: fc8 on gpu"), HasSubstr("Energy side by side")));
  EXPECT_THAT(text.err, HasSubstr("identity differs"));
  const auto json = pirt({"diff", file("a.db"), file("b.db"), "--json", "-"}).json();
  EXPECT_EQ(json["schema_version"], 1);
  EXPECT_EQ(json["same_identity"], false);
  for (const auto& row : json["figures"]) {
    EXPECT_EQ(row["workload"], "fc8");
    EXPECT_GT(row["ratio"], 0.0);
  }
  EXPECT_EQ(json["energies"].size(), 1U);
}

TEST_F(ExportDiff, DiffExplainsBadInput) {
  expect_refused(pirt({"diff", file("a.db")}), "two profile databases, not 1");
  expect_refused(pirt({"diff", file("a.db"), file("a.db")}), "the same file");
  std::filesystem::create_symlink(file("a.db"), file("link.db"));
  expect_refused(pirt({"diff", file("a.db"), file("link.db")}), "the same file");
  expect_refused(pirt({"diff", file("a.db"), file("c.db")}), "no cell in common");
  expect_refused(pirt({"diff", file("a.db"), file("none.db")}), "no profile database");
  expect_refused(pirt({"diff", file("a.db"), scratch_->write("text", "no database, really not")}),
                 "not a profile database");
  expect_refused(pirt({"diff", file("a.db"), file("b.db"), "--filter", "fc9"}), "fc8");
}

}  // namespace
}  // namespace pirt::test
