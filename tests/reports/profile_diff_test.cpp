// Two profiles side by side: what is compared, what is not, and what makes them not comparable.
#include "reports/profile/profile_diff.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/reports/profiles.h"
#include "tests/support/errors.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

using test::small_profile;
using testing::AllOf;
using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

TEST(ProfileDiff, DividesMediansAndComparesIntervals) {
  const Profile a = small_profile(100);  // intervals of 98 to 102 %
  const Profile near = small_profile(103);
  const Profile far = small_profile(105);
  const auto close = diff_profiles(a, near);
  ASSERT_THAT(close.phases, SizeIs(3));
  EXPECT_EQ(close.phases[0].a->phase, Phase::kPrepare);
  EXPECT_EQ(close.phases[0].overlap(), std::nullopt);  // no interval
  EXPECT_DOUBLE_EQ(close.phases[1].ratio().value(), 1.03);
  EXPECT_EQ(close.phases[1].overlap(), true);
  const auto apart = diff_profiles(a, far);
  EXPECT_DOUBLE_EQ(apart.phases[1].ratio().value(), 1.05);
  EXPECT_EQ(apart.phases[1].overlap(), false);  // 102 < 102.9
  EXPECT_DOUBLE_EQ(apart.energies.at(0).ratio().value(), 1.05);
}

TEST(ProfileDiff, InvalidRowsHaveNoRatio) {
  const Profile a = small_profile(100);
  Profile b = small_profile(200);
  b.phases[1].reasons = {"unstable"};
  const auto diff = diff_profiles(a, b);
  EXPECT_EQ(diff.phases[1].ratio(), std::nullopt);
  EXPECT_EQ(diff.phases[1].overlap(), std::nullopt);
  const auto text = render(diff_document(diff), Format::kText);
  EXPECT_THAT(text, AllOf(HasSubstr("invalid"), HasSubstr("b INVALID: unstable")));
  const auto json = diff_json(diff);
  EXPECT_FALSE(json["figures"][1].contains("ratio"));
  EXPECT_EQ(json["figures"][1]["b"]["reasons"][0], "unstable");
}

TEST(ProfileDiff, TellsIdentityFromInformation) {
  const Profile a = small_profile(100);
  Profile b = small_profile(100);
  b.runs[0].environment["load_1m"] = "7";
  EXPECT_THAT(diff_profiles(a, b).identity, IsEmpty());
  EXPECT_THAT(diff_profiles(a, b).information,
              ElementsAre(Field(&FactDifference::fact, "load_1m")));
  EXPECT_THAT(render(diff_document(diff_profiles(a, b)), Format::kText),
              HasSubstr("Identity (processor, devices, inputs, build) is the same"));
  b.runs[0].environment["cpu_model"] = "Other CPU";
  b.runs[0].seed = 2;
  b.runs[0].units[0].device = "Other device";
  const auto diff = diff_profiles(a, b);
  EXPECT_THAT(diff.identity, ElementsAre(Field(&FactDifference::fact, "seed"),
                                         Field(&FactDifference::fact, "unit.cpu.device"),
                                         Field(&FactDifference::fact, "cpu_model")));
  const auto text = render(diff_document(diff), Format::kText);
  EXPECT_LT(text.find("Other CPU"), text.find("Figures side by side"));
}

TEST(ProfileDiff, ComparesOnlyWhatBothHave) {
  const Profile a = small_profile(100);
  Profile b = small_profile(100);
  for (auto& row : b.phases) {
    if (row.workload == "fc8") row.unit = "gpu";
  }
  b.runs[0].units.push_back({"gpu", "fake", "only there", false, {}});
  b.runs[0].environment["unit.gpu.version"] = "3";
  b.runs[0].identity.insert("unit.gpu.version");
  const auto diff = diff_profiles(a, b);
  EXPECT_THAT(diff.identity, IsEmpty());  // the unit is not in a: nothing of it is compared
  EXPECT_THAT(diff.only_a, ElementsAre("fc8 on cpu"));
  EXPECT_THAT(diff.only_b, ElementsAre("fc8 on gpu"));
  EXPECT_THAT(render(diff_document(diff), Format::kText), HasSubstr("Only in b: fc8 on gpu"));
  for (auto& row : b.phases) row.unit = "gpu";
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(diff_profiles(a, b)); }),
              HasSubstr("no cell in common"));
}

TEST(ProfileDiff, MarksProvenance) {
  Profile a = small_profile(100);
  a.phases[1].provenance = Provenance::kModelled;
  const Profile b = small_profile(100);
  const auto diff = diff_profiles(a, b);
  EXPECT_THAT(render(diff_document(diff), Format::kText), HasSubstr("~100"));
  EXPECT_EQ(diff_json(diff)["figures"][1]["a"]["provenance"], "modelled");
}

}  // namespace
}  // namespace pirt
