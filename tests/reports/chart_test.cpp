// Charts, headings and folding, in text, Markdown and HTML.
#include "reports/document/chart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "reports/document/document.h"
#include "reports/document/page.h"

namespace pirt {
namespace {

using testing::HasSubstr;
using testing::Not;

Chart three_dots() {
  Chart chart{.kind = ChartKind::kDots, .summary = "Three dots.", .x = {"ms", true}};
  chart.table = {.title = "Dots",
                 .columns = {{"name", Align::kLeft}, {"ms"}},
                 .rows = {{"a", "1"}, {"b", "~10"}, {"c", "never"}},
                 .origin = "run 1"};
  chart.marks = {{.group = "a", .series = "cpu", .x = 1.0, .low = 1.0, .high = 10.0},
                 {.group = "b", .series = "cpu", .x = 10.0, .provenance = Provenance::kModelled},
                 {.group = "c", .series = "cpu", .word = "never"}};
  return chart;
}

TEST(Chart, StandsInTextAsItsTableWithAStrip) {
  // 32 places from 1 to 10, logarithmic: 1 is the first, 10 the last.
  const auto text = render({.title = "T", .parts = {three_dots()}}, Format::kText);
  std::string range = "●", far = "○";
  for (int i = 1; i < 32; ++i) range += "─";
  for (int i = 1; i < 32; ++i) far.insert(0, "·");
  EXPECT_THAT(text, HasSubstr("a     " + range + "      1\n"));
  EXPECT_THAT(text, HasSubstr("b     " + far + "    ~10\n"));
  EXPECT_THAT(text, HasSubstr("c     never                             never\n"));
  EXPECT_THAT(text, HasSubstr("\nThree dots.\n"));
  EXPECT_THAT(text, HasSubstr("\nFrom: run 1\n"));
}

TEST(Chart, HasTheSameRowsInMarkdown) {
  const auto markdown = render({.title = "T", .parts = {three_dots()}}, Format::kMarkdown);
  EXPECT_THAT(markdown, HasSubstr("## Dots\n\n| name | ms, logarithmic | ms |\n"));
  EXPECT_THAT(markdown, HasSubstr("○ | ~10 |\n"));
}

TEST(Chart, IsAFigureWithItsTableInHtml) {
  const auto html = render({.title = "T", .parts = {three_dots()}}, Format::kHtml);
  EXPECT_THAT(html, HasSubstr("<figure id=\"chart-1\">"));
  EXPECT_THAT(html, HasSubstr("3 rows as a table"));
  EXPECT_THAT(html, HasSubstr("<td class=\"r\">~10</td>"));
  if (page_has_charts()) {
    EXPECT_THAT(html, HasSubstr("\"provenance\":\"modelled\""));
    EXPECT_THAT(html, HasSubstr("drawTimeline"));
  } else {
    EXPECT_THAT(html, HasSubstr("node-d3"));
    EXPECT_THAT(html, Not(HasSubstr("<script")));
  }
}

TEST(Chart, DataCannotEndItsScript) {
  auto chart = three_dots();
  chart.marks[0].group = "</script><!--";
  chart.lines = {{.label = "</SCRIPT>", .y = 1.0}};
  const auto html = render({.title = "T", .parts = {chart}}, Format::kHtml);
  EXPECT_THAT(html, Not(HasSubstr("</script><!--")));
  EXPECT_THAT(html, Not(HasSubstr("</SCRIPT>")));
}

TEST(Heading, PutsTablesOneLevelBelow) {
  const Document document{
      .title = "T",
      .parts = {Heading{"One & all"}, Table{.title = "Figures", .columns = {{"ms"}}},
                Heading{"Two"}}};
  EXPECT_THAT(render(document, Format::kMarkdown), HasSubstr("## One \\& all\n\n### Figures\n"));
  EXPECT_THAT(render(document, Format::kText), HasSubstr("\nOne & all\n═════════\n"));
  const auto html = render(document, Format::kHtml);
  EXPECT_THAT(html, HasSubstr("<h2 id=\"section-1\">One &amp; all</h2>"));
  EXPECT_THAT(html, HasSubstr("<h3>Figures</h3>"));
  EXPECT_THAT(html, HasSubstr("<a href=\"#section-2\">Two</a>"));
}

Table wide() {
  return {.title = "Wide",
          .columns = {{"name", Align::kLeft}, {"one"}, {"two"}, {"remarks", Align::kLeft}},
          .rows = {{"x", "111111", "222222", "a remark of some words that is long"}},
          .footnotes = {"a note that is longer than that"}};
}

TEST(Text, FoldsATableThatIsWiderThanTheTerminal) {
  // 20 columns: name, one, two are 4 + 2 + 6 + 2 + 6 = 20; remarks go below, 16 at least a line,
  // beside 4 + 2 for the names.
  EXPECT_EQ(render({.title = "T", .parts = {wide()}}, Format::kText, 20),
            "T\n\nWide (1 of 2)\nname     one     two\n────────────────────\nx     111111  222222\n"
            "\nWide (2 of 2)\nname  remarks\n──────────────────────\n"
            "x     a remark of some\n      words that is\n      long\n"
            "a note that is\nlonger than that\n");
}

TEST(Text, IsNotFoldedWhereThereIsRoom) {
  const auto text = render({.title = "T", .parts = {wide()}}, Format::kText);
  EXPECT_EQ(text, render({.title = "T", .parts = {wide()}}, Format::kText, 200));
  EXPECT_THAT(text, HasSubstr("x     111111  222222  a remark of some words that is long\n"));
}

}  // namespace
}  // namespace pirt
