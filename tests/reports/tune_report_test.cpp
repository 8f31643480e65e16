// What `pirt tune` prints of what it found.
#include "reports/tools/tune_report.h"

#include <gmock/gmock.h>

#include "workloads/base/text/json.h"

namespace pirt {
namespace {

using opencl::info_of;
using opencl::Parameter;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

TuneFinding finding(Parameter parameter, TuneVerdict verdict) {
  TuneFinding found{.parameter = &info_of(parameter), .gains = {}, .rejected = {}, .reason = {}};
  found.standard = found.best = found.fastest = info_of(parameter).cpu.standard;
  found.verdict = verdict;
  return found;
}

TunedUnit tuned(std::vector<TuneFinding> findings) {
  TunedUnit unit{.unit = "opencl",
                 .device = {"a device", "a platform", "a driver", 2, true},
                 .outcome = {.tuning = opencl::Tuning(true), .findings = {}, .not_reached = {}},
                 .remarks = {}};
  unit.outcome.findings = std::move(findings);
  return unit;
}

TEST(TuneReport, HasARowForEachWorkloadThatGained) {
  auto found = finding(Parameter::kFcRows, TuneVerdict::kReplaced);
  found.best = found.fastest = 4;
  found.speed_up = 1.118;
  found.rounds = found.rounds_faster = 8;
  found.p_value = 1.0 / 256;
  found.gains = {{"fc6", 1.25}, {"fc8", 1.0}};
  const Table table = tune_table(tuned({found}));
  const std::string sure = "faster in 8 of 8 rounds (by chance: 0.39 %)";
  EXPECT_THAT(table.rows,
              ElementsAre(ElementsAre("fc6", "fc_rows", "8", "4", "1.25x", sure),
                          ElementsAre("fc8", "fc_rows", "8", "4", "1.00x", sure),
                          ElementsAre("geometric mean", "fc_rows", "8", "4", "1.12x", sure)));
}

TEST(TuneReport, SaysWhyADefaultStays) {
  auto best = finding(Parameter::kFcRows, TuneVerdict::kDefaultBest);
  best.gains = {{"fc6", 1}, {"fc7", 1}, {"fc8", 1}};
  auto slightly = finding(Parameter::kFilterRows, TuneVerdict::kDefaultBest);
  slightly.fastest = 8;
  slightly.speed_up = 1.012;
  slightly.rounds = slightly.rounds_faster = 3;
  auto lucky = finding(Parameter::kConvPixels, TuneVerdict::kNotConfirmed);
  lucky.fastest = 12;
  lucky.speed_up = 0.991;
  lucky.rounds = 8;
  lucky.rounds_faster = 3;
  lucky.gains = {{"conv1", 1}, {"conv2", 1}, {"conv3", 1}, {"conv4", 1}};
  const Table table = tune_table(tuned({best, slightly, lucky}));
  ASSERT_EQ(table.rows.size(), 3U);
  EXPECT_THAT(table.rows[0],
              ElementsAre("fc6 fc7 fc8", "fc_rows", "8", "8", "-", "no candidate was faster"));
  EXPECT_EQ(table.rows[1].back(), "8 is no 2 % faster: 1.01x, faster in 3 of 3 rounds");
  EXPECT_EQ(table.rows[2].front(), "4 workloads");
  EXPECT_EQ(table.rows[2].back(), "12 not confirmed: 0.99x, faster in 3 of 8 rounds");
}

TEST(TuneReport, NamesWhatWasRejectedAndWhatWasNotMeasured) {
  auto found = finding(Parameter::kFcRows, TuneVerdict::kNotMeasured);
  found.reason = "fc8: worker crashed";
  found.rejected = {{1, true, "fc6: off by 3"}, {2, false, "fc6: it does not build"}};
  auto unit = tuned({found});
  unit.outcome.not_reached = {"conv_pixels"};
  const Table table = tune_table(unit);
  EXPECT_THAT(table.rows[0], ElementsAre("-", "fc_rows", "8", "8", "-", "not measured (below)"));
  EXPECT_THAT(table.footnotes, Contains("fc_rows=1 computes something else: fc6: off by 3"));
  EXPECT_THAT(table.footnotes, Contains("fc_rows=2 is skipped: fc6: it does not build"));
  EXPECT_THAT(table.footnotes, Contains(HasSubstr("fc8: worker crashed")));
  EXPECT_THAT(table.footnotes, Contains(HasSubstr("No time for conv_pixels")));

  const auto json = tune_json(unit);
  EXPECT_EQ(json["parameters"][0]["verdict"], "not_measured");
  EXPECT_FALSE(json["parameters"][0].contains("speed_up")) << "nothing was measured";
  EXPECT_EQ(json["parameters"][0]["rejected"][0]["wrong_output"], true);
  EXPECT_EQ(json["not_reached"], Json::array({"conv_pixels"}));
}

}  // namespace
}  // namespace pirt
