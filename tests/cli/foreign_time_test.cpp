// A unit whose time is counted, as users meet it: characterize, report, schedule, regress, export.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kCounted = R"(platform: counted
description: a counted unit beside a modelled one
assumptions: none
units:
  cpu: {backend: fake, active_w: 2}
  fpga:
    backend: fake
    options: {slowdown: SLOWDOWN}
    contexts: {prepare_ms: 4}
    script:
      deterministic: true
      accounts: {device_init: counted, prepare: {unknown: loading is not modelled}, upload: published,
        launch: published, execute: counted, download: published}
)";

class ForeignTime : public testing::Test {
 protected:
  std::string platform(const std::string& slowdown) {
    std::string text = kCounted;
    text.replace(text.find("SLOWDOWN"), 8, slowdown);
    return scratch_.write("counted.yaml", text);
  }
  void characterize(const std::string& name, const std::string& slowdown) {
    const auto made = pirt({"characterize", "--quick", "--platform", platform(slowdown), "--filter",
                            "^(fc8|pool5)$", "--db", scratch_.file(name)});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    EXPECT_THAT(made.err, Not(HasSubstr("not valid")));
  }
  Scratch scratch_;
};

TEST_F(ForeignTime, GoesFromCharacterizeThroughReportAndExportToSchedules) {
  characterize("c.db", "1");
  const std::string db = scratch_.file("c.db");
  const auto report = pirt({"report", "setup", db});
  EXPECT_EQ(report.exit_code, 0) << report.err;
  EXPECT_THAT(report.out, HasSubstr("prepare is unknown: loading is not modelled"));
  EXPECT_THAT(pirt({"report", db}).out, HasSubstr("+*1.21"));
  const auto exported = pirt({"export", db, "--format", "json"}).json();
  for (const auto& row : exported["profile_summary"]) {
    if (row["unit"] != "fpga" || row["phase"] != "call") continue;
    EXPECT_EQ(row["mixture"], true);
    EXPECT_EQ(row["provenance"], "published");
    EXPECT_EQ(row["samples"], 1);
  }
  const auto mix = scratch_.write("m.yaml", R"(mix: m
pipelines: {p: {closed_loop: {frames: 3}, tasks: [{name: a, workload: fc8}, {name: b, workload: pool5, after: [a]}]}}
)");
  const auto compared =
      pirt({"schedule", "--platform", platform("1"), "--profile", db, "--mix", mix, "--compare"});
  EXPECT_EQ(compared.exit_code, 0) << compared.err;
  const auto run = pirt({"schedule", "--platform", platform("1"), "--profile", db, "--mix", mix,
                         "--mode", "throughput", "--json", "-"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto json = run.json();
  EXPECT_EQ(json["units"]["fpga"]["mixture"], true);
  EXPECT_TRUE(json["units"]["fpga"].contains("prepares"));
  EXPECT_FALSE(json["units"]["fpga"].contains("energy_j"));
  EXPECT_THAT(run.err + run.out, HasSubstr("energy of fpga is not known"));
}

TEST_F(ForeignTime, RegressFindsTheSameCountsTheSame) {
  characterize("a.db", "1");
  characterize("b.db", "1");
  const auto same = pirt({"regress", scratch_.file("a.db"), scratch_.file("b.db"), "--json", "-"});
  EXPECT_EQ(same.exit_code, 0) << same.err;
  const auto found = same.json();
  ASSERT_FALSE(found["rows"].empty());
  for (const auto& row : found["rows"]) EXPECT_NE(row["verdict"], "slower") << row;
}

// Options that change figures are identity: other ones make other units.
TEST_F(ForeignTime, OptionsAreIdentityAndAreChecked) {
  characterize("a.db", "1");
  characterize("b.db", "1.001");
  const auto other = pirt({"regress", scratch_.file("a.db"), scratch_.file("b.db")});
  EXPECT_EQ(other.exit_code, 3) << other.out;
  EXPECT_THAT(other.out, HasSubstr("slowdown=1.001"));
  const auto refused = pirt({"characterize", "--dry-run", "--platform", platform("0")});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("counted.yaml:8"), HasSubstr("slowdown")));
  auto text = std::string(kCounted);
  text.replace(text.find("slowdown: SLOWDOWN"), 18, "slowdwn: 1");
  const auto unknown =
      pirt({"characterize", "--dry-run", "--platform", scratch_.write("other.yaml", text)});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, AllOf(HasSubstr("no option 'slowdwn'"), HasSubstr("slowdown")));
  EXPECT_THAT(pirt({"list", "backends"}).out, HasSubstr("fake has option slowdown (default 1"));
}

}  // namespace
}  // namespace pirt::test
