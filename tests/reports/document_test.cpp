// Renderings of documents and the printing of figures.
#include "reports/document/document.h"

#include <gtest/gtest.h>

#include "reports/document/figures.h"
#include "workloads/base/text/printable.h"

namespace pirt {
namespace {

Document small() {
  return {.title = "T",
          .parts = {Paragraph{{"a < b"}}, Table{.title = "Figures",
                                                .columns = {{"name", Align::kLeft}, {"ms"}},
                                                .rows = {{"x|y", "1.5"}, {"µ", "10"}},
                                                .footnotes = {"note_1"}}}};
}

TEST(Document, AlignsTextColumnsByDisplayWidthNotBytes) {
  EXPECT_EQ(render(small(), Format::kText),
            "T\n\na < b\n\nFigures\nname   ms\n─────────\nx|y   1.5\nµ      10\nnote_1\n");
}

TEST(Document, EscapesMarkdownCells) {
  EXPECT_EQ(
      render(small(), Format::kMarkdown),
      "# T\n\n- a \\< b\n\n## Figures\n\n| name | ms |\n|:---|---:|\n| x\\|y | 1.5 |\n| µ | 10 |\n"
      "\nnote\\_1\n");
}

TEST(Document, LetsNoLinkOrEntityLiveInMarkdown) {
  const auto text = render({.title = "[a](javascript:alert(1))",
                            .parts = {Paragraph{{"![x](http://h/p) &lt;b&gt; <i>"}}}},
                           Format::kMarkdown);
  EXPECT_EQ(text, "# \\[a\\](javascript:alert(1))\n\n- !\\[x\\](http://h/p) \\&lt;b\\&gt; \\<i>\n");
}

TEST(Document, EscapesHtml) {
  const auto html =
      render({.title = "<script>", .parts = {Paragraph{{"a & \"b\""}}}}, Format::kHtml);
  EXPECT_EQ(html.find("<script>"), std::string::npos);
  EXPECT_NE(html.find("&lt;script&gt;"), std::string::npos);
  EXPECT_NE(html.find("a &amp; &quot;b&quot;"), std::string::npos);
}

TEST(Document, ShowsControlCharactersAndBrokenUtf8AsEscapes) {
  const Document document{
      .title = "T\x1b[2J",
      .parts = {Paragraph{{"one\ntwo"}}, Table{.title = "F\x7f",
                                               .columns = {{"name\r", Align::kLeft}},
                                               .rows = {{"\u009b31m"}, {"caf\xe9"}},
                                               .footnotes = {"tab\there"}}}};
  EXPECT_EQ(render(document, Format::kText),
            "T\\x1b[2J\n\none\\ntwo\n\nF\\x7f\nname\\r\n───────────\n\\xc2\\x9b31m\ncaf\\xe9\n"
            "tab\\there\n");
  for (const auto format : {Format::kText, Format::kMarkdown, Format::kHtml}) {
    EXPECT_FALSE(find_unprintable(render(document, format), "\n"));
  }
}

TEST(Figures, KeepThreeSignificantDigits) {
  EXPECT_EQ(figure(0.08912), "0.0891");
  EXPECT_EQ(figure(12.345), "12.3");
  EXPECT_EQ(figure(1234.5), "1234");
  EXPECT_EQ(figure(0.0), "0");
  EXPECT_EQ(figure(std::optional<double>{}), "-");
}

TEST(Figures, MarkProvenance) {
  EXPECT_EQ(marked("1", Provenance::kMeasured), "1");
  EXPECT_EQ(marked("1", Provenance::kModelled), "~1");
  EXPECT_EQ(duration_text(Nanos(1'234'000)), "1.23 ms");
}

TEST(Document, AsTextSaysAFootnoteOnce) {
  const Table table{.title = "t", .columns = {{"a"}}, .rows = {{"1"}}, .footnotes = {"legend"}};
  const Document document{.title = "d", .parts = {table, table}};
  const auto count = [&](Format format) {
    const auto text = render(document, format);
    std::size_t found = 0;
    for (auto at = text.find("legend"); at != std::string::npos; at = text.find("legend", at + 1)) {
      ++found;
    }
    return found;
  };
  EXPECT_EQ(count(Format::kText), 1U);
  EXPECT_EQ(count(Format::kMarkdown), 2U);
}

}  // namespace
}  // namespace pirt
