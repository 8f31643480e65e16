// The HTML report in a browser, as somebody opens it: every chart is drawn, says what its table
// says, and is reached with the keyboard; on a phone; dark; printed; with names that are markup.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"
#include "tests/support/browser.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

constexpr const char* kTab = "\uE004";
constexpr const char* kDown = "\uE015";
constexpr const char* kEnd = "\uE010";

class Page : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scratch_ = std::make_unique<Scratch>();
    const auto made = pirt({"characterize", "--quick", "--platform", "fake", "--filter",
                            "^(convolution|gaussian_blur|fc8)$", "--db", database()});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    const auto report = pirt({"report", "page", database(), "--mix", kMix, "-o", page()});
    ASSERT_EQ(report.exit_code, 0) << report.err;
  }
  static void TearDownTestSuite() { scratch_.reset(); }
  static std::string database() { return scratch_->file("profile.db"); }
  static std::string page() { return scratch_->file("report.html"); }
  static bool has_charts() { return slurp(page()).find("id=\"charts\"") != std::string::npos; }

  static constexpr const char* kMix = "convolution-1000";
  static inline std::unique_ptr<Scratch> scratch_;
};

#define BROWSER_OR_SKIP()                                  \
  if (!no_browser().empty()) GTEST_SKIP() << no_browser(); \
  if (!has_charts()) GTEST_SKIP() << "skipped: pirt was built without D3"

/// Of each chart: marks, rows, kind of what is drawn, width.
constexpr const char* kCharts = R"(
  return Array.from(document.querySelectorAll('figure'), (figure) => ({
    id: figure.id, marks: figure.querySelectorAll('.mark').length,
    empty: Array.from(figure.querySelectorAll('.mark')).filter((mark) => !mark.querySelector('path, rect')).length,
    rows: figure.querySelectorAll('tbody tr').length,
    broken: figure.querySelector('.plot').innerHTML.includes('NaN'),
    named: Array.from(figure.querySelectorAll('.mark')).every((mark) => mark.getAttribute('aria-label')),
    label: figure.querySelector('.plot > svg').getAttribute('aria-label'),
    summary: figure.querySelector('figcaption p').textContent}));)";

TEST_F(Page, DrawsAMarkForEachRowOfEachTable) {
  BROWSER_OR_SKIP();
  Browser browser(1100, 900);
  browser.open(page());
  const auto charts = browser.run(kCharts);
  ASSERT_GE(charts.size(), 9U);
  for (const auto& chart : charts) {
    EXPECT_GT(chart["rows"], 0) << chart;
    EXPECT_EQ(chart["marks"], chart["rows"]) << chart;
    EXPECT_EQ(chart["empty"], 0) << chart;
    EXPECT_EQ(chart["broken"], false) << chart;
    EXPECT_EQ(chart["named"], true) << chart;
    EXPECT_NE(chart["label"], "") << chart;
    EXPECT_NE(chart["summary"], "") << chart;
  }
  EXPECT_EQ(browser.console(), nlohmann::json::array());
}

TEST_F(Page, LoadsNothingFromAnywhere) {
  BROWSER_OR_SKIP();
  Browser browser(1100, 900);
  browser.open(page());
  EXPECT_EQ(browser.run("return performance.getEntriesByType('resource').length;"), 0);
}

TEST_F(Page, ArrowsGoFromMarkToMark) {
  BROWSER_OR_SKIP();
  Browser browser(1100, 900);
  browser.open(page());
  browser.run("document.querySelector('#chart-1 .mark').focus();");
  const auto read = [&] {
    return browser.run("return document.querySelector('#chart-1 .readout').textContent;")
        .get<std::string>();
  };
  const auto row = [&](const std::string& which) {
    return browser
        .run("return document.querySelector('#chart-1 tbody tr" + which +
             "').cells[0].textContent;")
        .get<std::string>();
  };
  EXPECT_THAT(read(), HasSubstr(row(":first-child")));
  const auto first = read();
  browser.press(kDown);
  EXPECT_NE(read(), first);
  browser.press(kEnd);
  EXPECT_THAT(read(), HasSubstr(row(":last-child")));
  // One Tab leaves the chart for its table; it does not go through every mark.
  browser.press(kTab);
  EXPECT_EQ(browser.run("return document.activeElement.tagName;"), "SUMMARY");
}

TEST_F(Page, FitsAPhoneAndSaysTheSame) {
  BROWSER_OR_SKIP();
  Browser browser(360, 740);
  browser.open(page());
  EXPECT_EQ(browser.run("return document.documentElement.scrollWidth;"), 360);
  for (const auto& chart : browser.run(kCharts)) {
    EXPECT_EQ(chart["marks"], chart["rows"]) << chart;
    EXPECT_EQ(chart["broken"], false) << chart;
  }
  // Texts stay within their drawings.
  const auto outside = browser.run(
      "return Array.from(document.querySelectorAll('.plot > svg')).flatMap((svg) => {"
      "  const box = svg.getBoundingClientRect();"
      "  return Array.from(svg.querySelectorAll('text')).filter((text) => {"
      "    const own = text.getBoundingClientRect();"
      "    return own.width > 0 && (own.left < box.left - 2 || own.right > box.right + 2);"
      "  }).map((text) => text.textContent); });");
  EXPECT_EQ(outside, nlohmann::json::array());
}

/// The ratio that text has to its background (WCAG 2.1), of body and of every series' colour.
constexpr const char* kContrasts = R"(
  const parse = (text) => text.match(/[\d.]+/g).slice(0, 3).map(Number);
  const light = (rgb) => rgb.map((v) => v / 255).map((v) => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const page = light(parse(getComputedStyle(document.body).backgroundColor));
  const ratio = (rgb) => { const own = light(rgb); return (Math.max(own, page) + 0.05) / (Math.min(own, page) + 0.05); };
  const probe = document.body.appendChild(document.createElement('i'));
  const of = (name) => { probe.style.color = `var(${name})`; return ratio(parse(getComputedStyle(probe).color)); };
  return {text: ['--ink', '--soft'].map(of), series: [0, 1, 2, 3, 4, 5, 6, 7].map((i) => of(`--s${i}`)).concat(of('--bad'))};)";

TEST_F(Page, IsReadableInLightAndDark) {
  BROWSER_OR_SKIP();
  Browser browser(1100, 900);
  browser.open(page());
  std::vector<std::string> backgrounds;
  for (const auto* colors : {"light", "dark"}) {
    browser.prefer(colors);
    backgrounds.push_back(
        browser.run("return getComputedStyle(document.body).backgroundColor;").get<std::string>());
    const auto found = browser.run(kContrasts);
    for (const double ratio : found["text"]) EXPECT_GE(ratio, 4.5) << colors;
    for (const double ratio : found["series"]) EXPECT_GE(ratio, 3.0) << colors;
  }
  EXPECT_NE(backgrounds[0], backgrounds[1]);
  browser.emulate_print();
  EXPECT_EQ(browser.run("return getComputedStyle(document.body).backgroundColor;"), backgrounds[0]);
}

TEST_F(Page, OpensItsTablesForPrint) {
  BROWSER_OR_SKIP();
  Browser browser(1100, 900);
  browser.open(page());
  const auto open = "return document.querySelectorAll('details:not([open])').length;";
  EXPECT_GT(browser.run(open), 0);
  browser.run("window.dispatchEvent(new Event('beforeprint'));");
  EXPECT_EQ(browser.run(open), 0);
  browser.run("window.dispatchEvent(new Event('afterprint'));");
  EXPECT_GT(browser.run(open), 0);
}

TEST_F(Page, ShowsNamesThatAreMarkupAsTheyAre) {
  const std::string evil = "</script><script>window.broken=1</script><img src=x onerror=alert(1)>";
  const auto trace = scratch_->file("trace.json");
  const auto scheduled = pirt({"schedule", "--mode", "latency", "--mix", kMix, "--profile",
                               database(), "--trace", trace, "--json", "-"});
  ASSERT_EQ(scheduled.exit_code, 0) << scheduled.err;
  auto record = scheduled.json();
  record["mode"] = evil;
  record["mix"] = evil;
  const auto run = scratch_->write("evil.json", record.dump());
  auto events = nlohmann::ordered_json::parse(slurp(trace));
  for (auto& event : events) {
    if (event["name"] == "pirt") event["args"]["mix"] = evil;
    if (event["ph"] == "X") event["name"] = evil + ".task";
  }
  const auto evil_trace = scratch_->write("evil-trace.json", events.dump());
  const auto out = scratch_->file("evil.html");
  const auto report =
      pirt({"report", "page", database(), run, evil_trace, "--mix", kMix, "-o", out});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  const auto html = slurp(out);
  EXPECT_EQ(html.find("<script>window.broken"), std::string::npos);
  EXPECT_EQ(html.find("<img"), std::string::npos);
  BROWSER_OR_SKIP();
  Browser browser(1100, 900);
  browser.open(out);
  EXPECT_EQ(browser.run("return window.broken === undefined;"), true);
  EXPECT_EQ(browser.run("return document.images.length;"), 0);
  EXPECT_THAT(browser.run("return document.body.textContent;").get<std::string>(), HasSubstr(evil));
  EXPECT_EQ(browser.console(), nlohmann::json::array());
}

TEST_F(Page, WithoutD3IsTablesThatSayWhatIsMissing) {
  if (has_charts()) GTEST_SKIP() << "skipped: pirt was built with D3";
  const auto html = slurp(page());
  EXPECT_THAT(html, HasSubstr("node-d3"));
  EXPECT_THAT(html, HasSubstr("<details open>"));
}

}  // namespace
}  // namespace pirt::test
