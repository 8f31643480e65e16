#include "reports/tools/fit_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "workloads/base/text/json.h"

namespace pirt {
namespace {

using testing::HasSubstr;

UnitFit fitted_unit() {
  UnitFit each;
  each.unit = "cpu";
  each.meter = "rapl: package-0 (package)";
  each.idle_w = 1.5;
  each.fit.parameters = {{EnergyParameter::kActive, 8, 0.25},
                         {EnergyParameter::kByte, 40, 60.0},
                         {EnergyParameter::kCall, 0, std::nullopt}};
  each.fit.residuals = {{"sobel", 0.010, 0.011}, {"fc8", 0.020, 0.0194}};
  each.fit.left_out = {"feature_detect"};
  each.dropped = {"op_pj is not fitted: because"};
  return each;
}

TEST(FitReport, PrintsParametersResidualsAndErrorsOfEachCell) {
  const auto tables = fit_tables(std::vector{fitted_unit()});
  Document document;
  for (const auto& table : tables) document.parts.emplace_back(table);
  const std::string text = render(document, Format::kText);
  EXPECT_THAT(text, HasSubstr("fitted to 2 cells of rapl: package-0 (package)"));
  EXPECT_THAT(text, HasSubstr("active_w   ^8.00  0.250  W"));
  EXPECT_THAT(text, HasSubstr("not told from 0"));     // 40 +/- 60
  EXPECT_THAT(text, HasSubstr("ended at its bound"));  // call_j
  EXPECT_THAT(text, HasSubstr("op_pj is not fitted: because"));
  EXPECT_THAT(text, HasSubstr("feature_detect"));
  EXPECT_THAT(text, HasSubstr("+10.0%"));
  EXPECT_THAT(text, HasSubstr("-3.0%"));
  // sqrt((10^2 + 3^2) / 2) = 7.4
  EXPECT_THAT(text, HasSubstr("root mean square 7.4 %, worst 10.0 %"));
}

TEST(FitReport, ARefusalHasItsReasonAndNoFigures) {
  UnitFit each;
  each.unit = "gpu";
  each.fit.refusal = "too few cells";
  const auto tables = fit_tables(std::vector{each});
  ASSERT_EQ(tables.size(), 1U);
  EXPECT_TRUE(tables[0].rows.empty());
  EXPECT_THAT(tables[0].footnotes, testing::ElementsAre("Not fitted: too few cells"));
  const auto json = fit_json(std::vector{each});
  EXPECT_EQ(json[0]["refusal"], "too few cells");
  EXPECT_TRUE(json[0]["parameters"].empty());
}

TEST(FitReport, JsonHasWhatTheTablesHave) {
  const auto json = fit_json(std::vector{fitted_unit()});
  EXPECT_EQ(json[0]["provenance"], "fitted");
  EXPECT_EQ(json[0]["parameters"][0]["value"], 8);
  EXPECT_EQ(json[0]["parameters"][1]["told_from_zero"], false);
  EXPECT_FALSE(json[0]["parameters"][2].contains("standard_error"));
  EXPECT_NEAR(json[0]["residuals"][1]["relative_error"], -0.03, 1e-9);
}

}  // namespace
}  // namespace pirt
