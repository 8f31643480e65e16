// Documents made of paragraphs and tables, and their renderings: text for a terminal, Markdown,
// HTML.
//
// What a report says is decided elsewhere; nothing here knows a profile or a run.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace pirt {

enum class Align : std::uint8_t { kLeft, kRight };

struct Column {
  std::string header;
  Align align = Align::kRight;
};

struct Table {
  std::string title = {};
  std::vector<Column> columns = {};
  std::vector<std::vector<std::string>> rows = {};  ///< Each as long as `columns`; UTF-8.
  std::vector<std::string> footnotes = {};
};

struct Paragraph {
  std::vector<std::string> lines;
};

struct Document {
  std::string title = {};
  std::vector<std::variant<Paragraph, Table>> parts = {};
};

enum class Format : std::uint8_t { kText, kMarkdown, kHtml };

/// A whole document, ending in a newline. HTML is one self-contained page; everything from outside
/// is escaped. What is not printable (base/printable.h) shows as escapes in every format.
[[nodiscard]] std::string render(const Document& given, Format format);

/// Columns that a terminal needs for @p text: code points (none here is wide or combining).
[[nodiscard]] std::size_t display_width(std::string_view text);

}  // namespace pirt
