#include "reports/document/page.h"

#include <fmt/core.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "report_page_files.h"
#include "reports/document/figures.h"
#include "workloads/base/embedded.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/markup.h"

namespace pirt {
namespace {

constexpr std::string_view kD3 = "d3.min.js";
constexpr std::size_t kLongCell = 28;  ///< Longer texts are broken into lines.

std::string_view asset(std::string_view name) {
  return find_embedded(report_page_files::files(), name).value_or("");
}

/// Within <script>, where nothing is escaped: no text may end the element or begin a comment.
std::string in_script(std::string text) {
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) {
    text.replace(at, 1, "\\u003c");
  }
  return text;
}

std::string row(const Table& table, const std::vector<std::string>& cells, std::string_view tag) {
  std::string line = "<tr>";
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const bool right = table.columns[c].align == Align::kRight;
    const std::string_view scope = tag == "th" ? " scope=\"col\"" : "";
    const std::string_view kind = cells[c].starts_with(kMiss)           ? " class=\"r miss\""
                                  : right                               ? " class=\"r\""
                                  : display_width(cells[c]) > kLongCell ? " class=\"long\""
                                                                        : "";
    line += fmt::format("<{}{}{}>{}</{}>", tag, scope, kind, escape_markup(cells[c]), tag);
  }
  return line + "</tr>\n";
}

/// Tables wider than the window scroll in a box of their own, which the keyboard reaches.
std::string rows(const Table& table) {
  std::vector<std::string> headers;
  for (const auto& column : table.columns) headers.push_back(column.header);
  std::string out = fmt::format(
      "<div class=\"scroll\" tabindex=\"0\" role=\"region\" "
      "aria-label=\"{}\"><table>\n<thead>{}</thead>\n<tbody>\n",
      escape_markup(table.title), row(table, headers, "th"));
  for (const auto& cells : table.rows) out += row(table, cells, "td");
  return out + "</tbody>\n</table></div>\n";
}

std::string notes(const Table& table) {
  std::string out;
  for (const auto& note : table.footnotes)
    out += "<p class=\"note\">" + escape_markup(note) + "</p>\n";
  if (!table.origin.empty())
    out += "<p class=\"note\">From: " + escape_markup(table.origin) + "</p>\n";
  return out;
}

Json json_of(const Mark& mark) {
  Json json = {{"group", mark.group}, {"series", mark.series}};
  json.put("x", mark.x);
  json.put("y", mark.y);
  json.put("low", mark.low);
  json.put("high", mark.high);
  if (!mark.values.empty()) json["values"] = mark.values;
  if (mark.provenance != Provenance::kMeasured) {
    json["provenance"] = to_string(mark.provenance);
    json["mark"] = ::pirt::mark(mark.provenance);
  }
  if (!mark.invalid.empty()) json["invalid"] = mark.invalid;
  if (!mark.doubt.empty()) json["doubt"] = mark.doubt;
  if (!mark.word.empty()) json["word"] = mark.word;
  if (mark.at_far_edge) json["far"] = true;
  return json;
}

Json json_of(const Chart& chart) {
  Json json = {{"kind", to_string(chart.kind)},
               {"title", chart.table.title},
               {"x", {{"label", chart.x.label}, {"log", chart.x.log}}},
               {"y", {{"label", chart.y.label}, {"log", chart.y.log}}},
               {"parts", chart.parts},
               {"series", chart.series},
               {"lines", Json::array()},
               {"marks", Json::array()}};
  for (const ReferenceLine& line : chart.lines) {
    Json each = {{"label", line.label}, {"points", line.points}};
    each.put("x", line.x);
    each.put("y", line.y);
    json["lines"].push_back(std::move(each));
  }
  for (const Mark& mark : chart.marks) json["marks"].push_back(json_of(mark));
  return json;
}

/// Renders the parts of a document, and collects what its script draws.
class Page {
 public:
  explicit Page(bool sections) : level_(sections ? 3 : 2) {}

  std::string operator()(const Heading& heading) {
    const auto id = fmt::format("section-{}", ++sections_);
    contents_ += fmt::format("<li><a href=\"#{}\">{}</a></li>\n", id, escape_markup(heading.text));
    return fmt::format("<h2 id=\"{}\">{}</h2>\n", id, escape_markup(heading.text));
  }
  std::string operator()(const Paragraph& paragraph) {
    std::string out;
    for (const auto& line : paragraph.lines) out += "<p>" + escape_markup(line) + "</p>\n";
    return out;
  }
  std::string operator()(const Table& table) { return title(table) + rows(table) + notes(table); }
  std::string operator()(const Chart& chart) {
    const auto id = fmt::format("chart-{}", charts_.size() + 1);
    charts_.push_back(json_of(chart));
    return fmt::format(
        "<figure id=\"{0}\">\n<figcaption>{1}<p id=\"{0}-summary\">{2}</p></figcaption>\n"
        "<div class=\"plot\"></div>\n<p class=\"readout\" aria-live=\"polite\"></p>\n"
        "<details{3}><summary>{4} as a table</summary>\n{5}</details>\n{6}</figure>\n",
        id, title(chart.table), escape_markup(chart.summary), page_has_charts() ? "" : " open",
        chart.marks.size() == 1 ? "1 row" : fmt::format("{} rows", chart.marks.size()),
        rows(chart.table), notes(chart.table));
  }

  [[nodiscard]] const Json& charts() const { return charts_; }
  /// Links to the sections; empty if there are fewer than two.
  [[nodiscard]] std::string contents() const {
    if (sections_ < 2) return "";
    return "<nav aria-label=\"Sections\"><ul>\n" + contents_ + "</ul></nav>\n";
  }

 private:
  [[nodiscard]] std::string title(const Table& table) const {
    return fmt::format("<h{0}>{1}</h{0}>\n", level_, escape_markup(table.title));
  }

  int level_;
  int sections_ = 0;
  std::string contents_;
  Json charts_ = Json::array();
};

/// Nothing may come from the network, whatever a name in the report says.
constexpr std::string_view kPolicy =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

constexpr std::string_view kNoCharts =
    "<p class=\"missing\">The charts of this report are missing: this pirt was built without D3 "
    "(Debian's package node-d3). Their tables are all here.</p>\n";

std::string scripts(const Json& charts) {
  if (charts.empty() || !page_has_charts()) return "";
  return fmt::format(
      "<script type=\"application/json\" id=\"charts\">{}</script>\n<script>{}</script>\n"
      "<script>{}</script>\n",
      in_script(json_text(charts)), asset(kD3), asset("charts.js"));
}

}  // namespace

bool page_has_charts() { return !asset(kD3).empty(); }

std::string page(const Document& document) {
  const bool sections = std::ranges::any_of(
      document.parts, [](const auto& part) { return std::holds_alternative<Heading>(part); });
  Page renderer(sections);
  std::string body;
  for (const auto& part : document.parts) body += std::visit(renderer, part);
  const bool lacks = !renderer.charts().empty() && !page_has_charts();
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"{}\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta name=\"color-scheme\" content=\"light dark\"><title>{}</title>\n"
      "<style>{}</style></head>\n<body>\n<h1>{}</h1>\n{}{}<main>\n{}</main>\n{}</body></html>\n",
      kPolicy, escape_markup(document.title), asset("page.css"), escape_markup(document.title),
      lacks ? kNoCharts : std::string_view(), renderer.contents(), body,
      scripts(renderer.charts()));
}

}  // namespace pirt
