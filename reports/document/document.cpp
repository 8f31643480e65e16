#include "reports/document/document.h"

#include <algorithm>
#include <set>

#include "reports/document/document_text.h"
#include "reports/document/page.h"
#include "workloads/base/text/printable.h"

namespace pirt {
namespace {

/// Nothing in it is markup, a link or an entity any more.
std::string escape_markdown(std::string_view text) {
  constexpr std::string_view kMarkup = "|*_`<\\[]&";
  std::string out;
  for (const char c : text) {
    if (kMarkup.find(c) != std::string_view::npos) out += '\\';
    out += c;
  }
  return out;
}

/// A terminal's lines are few: what stands under one table is not repeated under the next.
void say_once(Document& document) {
  std::set<std::string> said;
  for (Part& part : document.parts) {
    auto* const chart = std::get_if<Chart>(&part);
    auto* const table = chart != nullptr ? &chart->table : std::get_if<Table>(&part);
    if (table == nullptr) continue;
    std::erase_if(table->footnotes,
                  [&](const std::string& note) { return !said.insert(note).second; });
  }
}

std::string markdown_row(const std::vector<std::string>& cells) {
  std::string line = "|";
  for (const auto& cell : cells) line += " " + escape_markdown(cell) + " |";
  return line + "\n";
}

/// Renders the parts of a document, one after the other.
class Text {
 public:
  explicit Text(std::size_t columns) : columns_(columns) {}
  [[nodiscard]] std::string operator()(const Heading& heading) const {
    std::string rule;
    for (std::size_t i = 0; i < display_width(heading.text); ++i) rule += "═";
    return heading.text + "\n" + rule + "\n";
  }
  [[nodiscard]] std::string operator()(const Paragraph& paragraph) const {
    std::string out;
    for (const auto& each : paragraph.lines) {
      for (const auto& line : wrapped(each, columns_)) out += line + "\n";
    }
    return out;
  }
  [[nodiscard]] std::string operator()(const Table& table) const {
    return text_table(table, columns_);
  }
  [[nodiscard]] std::string operator()(const Chart& chart) const {
    return text_table(text_table_of(chart), columns_);
  }

 private:
  std::size_t columns_;
};

class Markdown {
 public:
  /// @param level  Of tables: one below the headings, if there are any.
  explicit Markdown(std::string level) : level_(std::move(level)) {}
  [[nodiscard]] std::string operator()(const Heading& heading) const {
    return "## " + escape_markdown(heading.text) + "\n";
  }
  [[nodiscard]] std::string operator()(const Paragraph& paragraph) const {
    std::string out;
    for (const auto& line : paragraph.lines) out += "- " + escape_markdown(line) + "\n";
    return out;
  }
  [[nodiscard]] std::string operator()(const Table& table) const {
    std::vector<std::string> headers;
    for (const auto& column : table.columns) headers.push_back(column.header);
    std::string out = level_ + escape_markdown(table.title) + "\n\n" + markdown_row(headers) + "|";
    for (const auto& column : table.columns) {
      out += column.align == Align::kRight ? "---:|" : ":---|";
    }
    out += "\n";
    for (const auto& row : table.rows) out += markdown_row(row);
    for (const auto& note : table.footnotes) out += "\n" + escape_markdown(note) + "\n";
    if (!table.origin.empty()) out += "\nFrom: " + escape_markdown(table.origin) + "\n";
    return out;
  }
  [[nodiscard]] std::string operator()(const Chart& chart) const {
    return (*this)(text_table_of(chart));
  }

 private:
  std::string level_;
};

void make_printable(std::string& text) { text = printable(text); }
void make_printable(std::vector<std::string>& texts) {
  for (auto& text : texts) make_printable(text);
}
void make_printable(Heading& heading) { make_printable(heading.text); }
void make_printable(Paragraph& paragraph) { make_printable(paragraph.lines); }
void make_printable(Table& table) {
  make_printable(table.title);
  for (auto& column : table.columns) make_printable(column.header);
  for (auto& row : table.rows) make_printable(row);
  make_printable(table.footnotes);
  make_printable(table.origin);
}
void make_printable(Chart& chart) {
  make_printable(chart.table);
  make_printable(chart.summary);
  make_printable(chart.parts);
  make_printable(chart.series);
  for (Mark& mark : chart.marks) {
    for (auto* text : {&mark.group, &mark.series, &mark.invalid, &mark.word}) make_printable(*text);
  }
  for (ReferenceLine& line : chart.lines) make_printable(line.label);
}

}  // namespace

std::size_t display_width(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

std::string render(const Document& given, Format format, std::size_t columns) {
  // Names may come from files of others; a terminal obeys control characters, and a line break in
  // a cell would make a row of it.
  Document document = given;
  make_printable(document.title);
  for (auto& part : document.parts) {
    std::visit([](auto& each) { make_printable(each); }, part);
  }
  if (format == Format::kHtml) return page(document);
  if (format == Format::kText) say_once(document);
  const bool sections = std::ranges::any_of(
      document.parts, [](const auto& part) { return std::holds_alternative<Heading>(part); });
  const bool text = format == Format::kText;
  std::string out = text ? document.title + "\n" : "# " + escape_markdown(document.title) + "\n";
  for (const auto& part : document.parts) {
    out += "\n" + (text ? std::visit(Text(columns), part)
                        : std::visit(Markdown(sections ? "### " : "## "), part));
  }
  return out;
}

}  // namespace pirt
