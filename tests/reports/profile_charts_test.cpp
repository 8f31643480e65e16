// Pictures of profiles: a mark a row, invalid and modelled ones marked as such; several profiles.
#include "reports/profile/profile_charts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "reports/full_report.h"
#include "reports/profile/setup_report.h"
#include "reports/profile/side_by_side.h"
#include "tests/reports/profiles.h"

namespace pirt {
namespace {

using test::small_profile;
using testing::HasSubstr;

TEST(ProfileCharts, ShowFamiliesApart) {
  Profile profile = small_profile(2);
  profile.path = "My profiles/p.db";
  profile.runs.front().environment["command"] = "pirt characterize --quick --platform 'my board'";
  const auto charts = time_charts(profile);
  ASSERT_EQ(charts.size(), 2U);
  EXPECT_THAT(charts[0].table.title, HasSubstr("Fig. 3"));  // sobel
  EXPECT_THAT(charts[1].table.title, HasSubstr("Fig. 5"));  // fc8
  EXPECT_DOUBLE_EQ(*charts[0].marks[0].x, 2);
  EXPECT_THAT(
      charts[0].table.origin,
      HasSubstr("again: pirt characterize --quick --platform 'my board' --db 'My profiles/p.db'"));
  profile.runs.front().environment = {{"source", "their.json"}};
  EXPECT_THAT(time_charts(profile)[0].table.origin, HasSubstr("published: their.json"));
  const auto energy = energy_charts(small_profile(2));
  ASSERT_EQ(energy.size(), 1U);
  EXPECT_DOUBLE_EQ(*energy[0].marks[0].x, 2);  // mJ
  EXPECT_EQ(energy[0].marks[0].provenance, Provenance::kModelled);
}

TEST(ProfileCharts, KeepInvalidRowsAndSayWhy) {
  auto profile = small_profile(2);
  profile.phases[1].reasons = {"unstable"};
  const auto chart = time_charts(profile)[0];
  ASSERT_EQ(chart.marks.size(), 1U);
  EXPECT_EQ(chart.marks[0].invalid, "unstable");
  EXPECT_THAT(chart.table.rows[0].back(), HasSubstr("INVALID: unstable"));
}

TEST(ProfileCharts, MarkDoubtedFiguresAndShowTheirIntervals) {
  auto profile = small_profile(2);
  profile.phases[1].doubts = profile.energies[0].doubts = {"contended"};
  profile.energies[0].ci_low_j = 0.0018;
  profile.energies[0].ci_high_j = 0.0022;
  EXPECT_EQ(time_charts(profile)[0].table.rows[0][2], "2.00?");
  const auto energy = energy_charts(profile)[0];
  EXPECT_EQ(energy.table.rows[0][2], "~2.00?");
  EXPECT_DOUBLE_EQ(*energy.marks[0].low, 1.8);
  EXPECT_DOUBLE_EQ(*energy.marks[0].high, 2.2);
  EXPECT_EQ(best_units_table(std::vector{profile, small_profile(3)}).rows[0][1], "cpu, 2.00? ms");
}

TEST(ProfileCharts, ShowSamplesAsAtMostTwoHundredQuantiles) {
  auto profile = small_profile(2);
  for (int i = 0; i <= 10'000; ++i) profile.phases[1].values.push_back(from_ms(2 + 0.001 * i));
  profile.phases[1].samples = 10'001;
  const auto chart = distribution_chart(profile);
  ASSERT_EQ(chart.marks.size(), 2U);  // calls of sobel and fc8
  const auto& values = chart.marks[0].values;
  ASSERT_EQ(values.size(), kMostQuantiles);
  EXPECT_DOUBLE_EQ(values.front(), 1);
  EXPECT_DOUBLE_EQ(values.back(), 6);  // 12 ms over 2 ms
  EXPECT_TRUE(std::ranges::is_sorted(values));
  EXPECT_THAT(chart.table.rows[0], testing::Contains("10001"));
  EXPECT_TRUE(chart.marks[1].values.empty());
}

TEST(SideBySide, ComparesProfilesAndSaysWhatDiffers) {
  auto other = small_profile(3);
  other.path = "other.db";
  other.runs[0].environment["cpu_model"] = "Another CPU";
  const std::vector<Profile> profiles = {small_profile(2), other};
  const auto table = identities_table(profiles);
  EXPECT_THAT(table.rows[1].back(), HasSubstr("cpu_model"));
  const auto chart = side_by_side_chart(profiles);
  ASSERT_EQ(chart.marks.size(), 4U);
  EXPECT_EQ(chart.table.rows[1][2], "other.db");
  EXPECT_EQ(chart.table.rows[1][4], "1.50x");
  EXPECT_EQ(best_units_table(profiles).rows[0][3], "cpu, 3.00 ms");
}

TEST(SideBySide, FilesOfOneNameAreToldApart) {
  auto other = small_profile(3);
  other.path = "elsewhere/small.db";
  const auto names = names_of(std::vector{small_profile(2), other});
  EXPECT_NE(names[0], names[1]);
}

Mix no_tasks() {
  Mix mix;
  mix.name = "none";
  return mix;
}

TEST(FullReport, SaysThatRunsAreOfAnotherPlatform) {
  ReportInputs inputs;
  inputs.mix = no_tasks();
  inputs.machines.push_back(machine_of(small_profile(2), std::nullopt, inputs.mix, "no platform"));
  RunRecord run;
  run.mode = "energy";
  run.platform = "elsewhere";
  inputs.runs = {run};
  const auto notes = mismatches(inputs);
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_THAT(notes[0], HasSubstr("platform elsewhere, the database of board"));
  EXPECT_THAT(render(full_report(inputs), Format::kText), HasSubstr("NOT COMPARABLE: the run"));
}

TEST(FullReport, EveryChartHasAsManyMarksAsRowsAndTheSameContentInEachFormat) {
  auto slower = small_profile(3);
  slower.path = "slower.db";
  ReportInputs inputs;
  inputs.mix = no_tasks();
  inputs.machines.push_back(machine_of(small_profile(2), std::nullopt, inputs.mix, "no platform"));
  inputs.machines.push_back(machine_of(slower, std::nullopt, inputs.mix, "no platform"));
  const auto document = full_report(inputs);
  const auto text = render(document, Format::kText);
  const auto markdown = render(document, Format::kMarkdown);
  const auto html = render(document, Format::kHtml);
  EXPECT_THAT(text, HasSubstr("slower.db: Time and energy"));
  for (const Part& part : document.parts) {
    const auto* chart = std::get_if<Chart>(&part);
    if (chart != nullptr) {
      EXPECT_EQ(chart->marks.size(), chart->table.rows.size());
    }
    const auto* table = chart != nullptr ? &chart->table : std::get_if<Table>(&part);
    if (table == nullptr) continue;
    EXPECT_NE(table->title, "");
    for (const auto& row : table->rows) EXPECT_EQ(row.size(), table->columns.size());
    // Without what Markdown and HTML escape.
    const auto title = table->title.substr(0, table->title.find_first_of("'_<&("));
    for (const auto* form : {&text, &markdown, &html}) EXPECT_THAT(*form, HasSubstr(title));
  }
}

}  // namespace
}  // namespace pirt
