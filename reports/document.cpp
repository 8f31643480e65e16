#include "reports/document.h"

#include <algorithm>

#include "workloads/base/printable.h"

namespace pirt {
namespace {

std::string pad(std::string_view text, std::size_t width, Align align) {
  const std::size_t used = display_width(text);
  const std::string space(width > used ? width - used : 0, ' ');
  return align == Align::kRight ? space + std::string(text) : std::string(text) + space;
}

std::string trim_right(std::string line) {
  line.erase(line.find_last_not_of(' ') + 1);
  return line;
}

std::string text_row(const Table& table, const std::vector<std::string>& cells,
                     const std::vector<std::size_t>& widths) {
  std::string line;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    if (c != 0) line += "  ";
    line += pad(cells[c], widths[c], table.columns[c].align);
  }
  return trim_right(std::move(line)) + "\n";
}

std::string headers_rule(const std::vector<std::size_t>& widths) {
  std::size_t total = widths.empty() ? 0 : 2 * (widths.size() - 1);
  for (const std::size_t width : widths) total += width;
  std::string rule;
  for (std::size_t i = 0; i < total; ++i) rule += "─";
  return rule + "\n";
}

std::vector<std::string> headers(const Table& table) {
  std::vector<std::string> names;
  for (const auto& column : table.columns) names.push_back(column.header);
  return names;
}

std::string text_table(const Table& table) {
  std::vector<std::size_t> widths;
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    std::size_t width = display_width(table.columns[c].header);
    for (const auto& row : table.rows) width = std::max(width, display_width(row[c]));
    widths.push_back(width);
  }
  std::string out =
      table.title + "\n" + text_row(table, headers(table), widths) + headers_rule(widths);
  for (const auto& row : table.rows) out += text_row(table, row, widths);
  for (const auto& note : table.footnotes) out += note + "\n";
  return out;
}

std::string escape_markdown(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '|' || c == '*' || c == '_' || c == '`' || c == '<' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

std::string markdown_row(const std::vector<std::string>& cells) {
  std::string line = "|";
  for (const auto& cell : cells) line += " " + escape_markdown(cell) + " |";
  return line + "\n";
}

std::string markdown_table(const Table& table) {
  std::string out =
      "## " + escape_markdown(table.title) + "\n\n" + markdown_row(headers(table)) + "|";
  for (const auto& column : table.columns) out += column.align == Align::kRight ? "---:|" : ":---|";
  out += "\n";
  for (const auto& row : table.rows) out += markdown_row(row);
  for (const auto& note : table.footnotes) out += "\n" + escape_markdown(note) + "\n";
  return out;
}

std::string escape_html(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string html_row(const Table& table, const std::vector<std::string>& cells,
                     std::string_view tag) {
  std::string line = "<tr>";
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const bool right = table.columns[c].align == Align::kRight;
    line += "<" + std::string(tag) + (right ? " class=\"r\">" : ">") + escape_html(cells[c]) +
            "</" + std::string(tag) + ">";
  }
  return line + "</tr>\n";
}

std::string html_table(const Table& table) {
  std::string out = "<h2>" + escape_html(table.title) + "</h2>\n<table>\n<thead>" +
                    html_row(table, headers(table), "th") + "</thead>\n<tbody>\n";
  for (const auto& row : table.rows) out += html_row(table, row, "td");
  out += "</tbody>\n</table>\n";
  for (const auto& note : table.footnotes)
    out += "<p class=\"note\">" + escape_html(note) + "</p>\n";
  return out;
}

constexpr std::string_view kStyle =
    "body{font:15px/1.5 system-ui,sans-serif;max-width:75em;margin:2em auto;padding:0 1em;"
    "color:#1b1f24;background:#fff}"
    "table{border-collapse:collapse;display:block;overflow-x:auto}"
    "th,td{padding:.25em .7em;border-bottom:1px solid #d5d9de;text-align:left;white-space:nowrap}"
    "th{border-bottom:2px solid #6a737d}.r{text-align:right;font-variant-numeric:tabular-nums}"
    ".note{color:#57606a;margin:.3em 0;font-size:.9em}";

std::string render_part(const Paragraph& paragraph, Format format) {
  std::string out;
  if (format == Format::kHtml) {
    for (const auto& line : paragraph.lines) out += "<p>" + escape_html(line) + "</p>\n";
    return out;
  }
  for (const auto& line : paragraph.lines) {
    out += format == Format::kMarkdown ? "- " + escape_markdown(line) + "\n" : line + "\n";
  }
  return out;
}

std::string render_part(const Table& table, Format format) {
  switch (format) {
    case Format::kText:
      return text_table(table);
    case Format::kMarkdown:
      return markdown_table(table);
    case Format::kHtml:
      return html_table(table);
  }
  return {};
}

void make_printable(std::vector<std::string>& texts) {
  for (auto& text : texts) text = printable(text);
}

void make_printable(Paragraph& paragraph) { make_printable(paragraph.lines); }

void make_printable(Table& table) {
  table.title = printable(table.title);
  for (auto& column : table.columns) column.header = printable(column.header);
  for (auto& row : table.rows) make_printable(row);
  make_printable(table.footnotes);
}

}  // namespace

std::size_t display_width(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

std::string render(const Document& given, Format format) {
  // Names may come from files of others; a terminal obeys control characters, and a line break in
  // a cell would make a row of it.
  Document document = given;
  document.title = printable(document.title);
  for (auto& part : document.parts) {
    std::visit([](auto& each) { make_printable(each); }, part);
  }
  std::string out;
  switch (format) {
    case Format::kText:
      out = document.title + "\n";
      break;
    case Format::kMarkdown:
      out = "# " + escape_markdown(document.title) + "\n";
      break;
    case Format::kHtml:
      out =
          "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
          "<meta name=\"viewport\" content=\"width=device-width\"><title>" +
          escape_html(document.title) + "</title>\n<style>" + std::string(kStyle) +
          "</style></head>\n<body>\n<h1>" + escape_html(document.title) + "</h1>\n";
      break;
  }
  for (const auto& part : document.parts) {
    if (format != Format::kHtml) out += "\n";
    out += std::visit([&](const auto& p) { return render_part(p, format); }, part);
  }
  if (format == Format::kHtml) out += "</body></html>\n";
  return out;
}

}  // namespace pirt
