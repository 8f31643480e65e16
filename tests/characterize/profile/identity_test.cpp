// What must match for two runs to be compared, and what may differ.
#include "characterize/profile/identity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "characterize/machine/environment_keys.h"

namespace pirt {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

RunInfo run() {
  RunInfo info;
  info.platform = "host";
  info.seed = 1;
  info.environment = {{"cpu_model", "Some CPU"},       {"governor", "performance"},
                      {"git_commit", "abc"},           {"load_1m", "0.10"},
                      {"turbo_unknown", "no cpufreq"}, {"unit.cpu.version", "OpenCV 4.6"}};
  info.units = {{"cpu", "cpu", "Some CPU", true, {0}}, {"gpu", "opencl", "pthread", true, {1}}};
  return info;
}

std::vector<std::string> fields(const RunInfo& a, const RunInfo& b) {
  std::vector<std::string> names;
  for (const auto& difference : compare_identity(a, b)) names.push_back(difference.field);
  return names;
}

TEST(Identity, HoldsWhatDecidesTheSpeedOfUnchangedCode) {
  const std::map<std::string, std::string> expected = {{"platform", "host"},
                                                       {"seed", "1"},
                                                       {"cpu_model", "Some CPU"},
                                                       {"governor", "performance"},
                                                       {"unit.cpu.version", "OpenCV 4.6"},
                                                       {"unit.cpu.backend", "cpu"},
                                                       {"unit.cpu.device", "Some CPU"},
                                                       {"unit.cpu.cores", "0"},
                                                       {"unit.gpu.backend", "opencl"},
                                                       {"unit.gpu.device", "pthread"},
                                                       {"unit.gpu.cores", "1"},
                                                       // Not recorded by a version of before.
                                                       {"unit.gpu.tuning", "default"}};
  EXPECT_EQ(identity_of(run()), expected);
}

TEST(Identity, LetsTheMomentAndTheCommitDiffer) {
  RunInfo other = run();
  other.run_id = 7;
  other.started = "2030-01-01T00:00:00Z";
  other.environment["git_commit"] = "def";
  other.environment["load_1m"] = "3.00";
  other.environment["something_new"] = "x";
  EXPECT_THAT(compare_identity(run(), other), IsEmpty());
}

TEST(Identity, NamesEachFieldThatDiffersWithBothValuesAndWhy) {
  RunInfo other = run();
  other.seed = 2;
  other.environment["governor"] = "powersave";
  other.units[0].device = "Other CPU";
  const auto differences = compare_identity(run(), other);
  ASSERT_EQ(differences.size(), 3U);  // in the order of environment_keys()
  EXPECT_EQ(differences[0].field, "seed");
  EXPECT_EQ(differences[0].unit, "");
  EXPECT_EQ(describe(differences[1]), "unit.cpu.device: Some CPU against Other CPU");
  EXPECT_EQ(differences[1].unit, "cpu");
  EXPECT_EQ(describe(differences[2]), "governor: performance against powersave");
  EXPECT_EQ(differences[2].why, find_environment_key("governor")->why);
}

TEST(Identity, IsSymmetricInItsFields) {
  RunInfo other = run();
  other.platform = "board";
  other.environment.erase("cpu_model");
  EXPECT_THAT(fields(run(), other), ElementsAre("platform", "cpu_model"));
  EXPECT_EQ(fields(run(), other), fields(other, run()));
}

TEST(Identity, WhatNeitherKnowsIsNoDifferenceAndWhatOneKnowsIsOne) {
  RunInfo other = run();
  other.environment["turbo_unknown"] = "for another reason";
  EXPECT_THAT(compare_identity(run(), other), IsEmpty());
  other.environment.erase("turbo_unknown");  // an older version did not look
  EXPECT_THAT(compare_identity(run(), other), IsEmpty());
  other.environment["turbo"] = "on";
  const auto differences = compare_identity(run(), other);
  ASSERT_EQ(differences.size(), 1U);
  EXPECT_EQ(describe(differences[0]), "turbo: not known against on");
}

TEST(Identity, AKeyOfAnotherVersionIsWhatThatVersionTookItFor) {
  RunInfo newer = run();
  newer.environment["warp_factor"] = "9";
  EXPECT_THAT(compare_identity(run(), newer), IsEmpty());
  newer.identity = {"warp_factor"};
  EXPECT_THAT(fields(run(), newer), ElementsAre("warp_factor"));
}

TEST(Identity, AUnitThatOnlyOneRunMeasuredIsNoDifference) {
  RunInfo other = run();
  other.units.pop_back();
  other.environment["unit.dsp.version"] = "1";
  EXPECT_THAT(compare_identity(run(), other), IsEmpty());
  other.units[0].cores = {1};
  EXPECT_THAT(fields(run(), other), ElementsAre("unit.cpu.cores"));
}

TEST(Identity, AUnitWithoutCoresHasThoseThatTheProcessMayUse) {
  RunInfo one = run();
  one.units = {{"cpu", "cpu", "Some CPU", true, {}}, {"gpu", "opencl", "a board", false, {}}};
  one.environment["cores_usable"] = "0";
  RunInfo two = one;
  two.environment["cores_usable"] = "0,1";
  EXPECT_THAT(fields(one, two), ElementsAre("unit.cpu.cores"));
  two.units[0].cores = {0};
  EXPECT_THAT(compare_identity(one, two), IsEmpty());
}

TEST(Identity, OfAUnitIsWithoutThatOfOthers) {
  RunInfo other = run();
  other.environment["governor"] = "powersave";
  other.units[0].device = "Other CPU";
  other.units[1].device = "llvmpipe";
  EXPECT_EQ(describe(compare_identity(run(), other, "gpu")),
            "unit.gpu.device: pthread against llvmpipe; governor: performance against powersave");
  EXPECT_EQ(describe(compare_identity(run(), run(), "gpu")), "");
}

TEST(EnvironmentKeys, ReadUnitsWithDotsInTheirNames) {
  EXPECT_EQ(unit_of_key("unit.left.gpu.version"), "left.gpu");
  EXPECT_EQ(unit_of_key("governor"), "");
  ASSERT_NE(find_environment_key("unit.left.gpu.version"), nullptr);
  EXPECT_EQ(find_environment_key("unit..version"), nullptr);
  EXPECT_EQ(fact_kind("governor_unknown"), FactKind::kIdentity);
  EXPECT_EQ(fact_kind("from_the_future"), FactKind::kInformation);
}

}  // namespace
}  // namespace pirt
