// Documents made of headings, paragraphs, tables and charts, and their renderings: text for a
// terminal, Markdown, HTML.
//
// What a report says is decided elsewhere; nothing here knows a profile or a run.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "reports/document/chart.h"
#include "reports/document/table.h"

namespace pirt {

/// Begins a section. The tables and charts behind it are one level below it.
struct Heading {
  std::string text;
};

struct Paragraph {
  std::vector<std::string> lines;
};

using Part = std::variant<Paragraph, Table, Heading, Chart>;

struct Document {
  std::string title = {};
  std::vector<Part> parts = {};
};

enum class Format : std::uint8_t { kText, kMarkdown, kHtml };

/// A whole document, ending in a newline. HTML is one self-contained page (page/page.h); everything
/// from outside is escaped. What is not printable (base/printable.h) shows as escapes in every
/// format. Text has each footnote once.
/// @param columns  Text only: tables that are wider are folded, footnotes and paragraphs wrapped;
/// 0 = as wide as they are.
[[nodiscard]] std::string render(const Document& given, Format format, std::size_t columns = 0);

/// Columns that a terminal needs for @p text: code points (none here is wide or combining).
[[nodiscard]] std::size_t display_width(std::string_view text);

}  // namespace pirt
