#include "reports/document/document_text.h"

#include <fmt/core.h>

#include <algorithm>

#include "reports/document/document.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr std::size_t kGap = 2;
/// Narrower than this nothing is wrapped: a word a line is worse than a line that is too long.
constexpr std::size_t kLeastWidth = 16;

std::string pad(std::string_view text, std::size_t width, Align align) {
  const std::size_t used = display_width(text);
  const std::string space(width > used ? width - used : 0, ' ');
  return align == Align::kRight ? space + std::string(text) : std::string(text) + space;
}

std::string trim_right(std::string line) {
  line.erase(line.find_last_not_of(' ') + 1);
  return line;
}

/// Columns of a table that stand side by side, each with its width.
struct Block {
  std::vector<std::size_t> columns;
  std::vector<std::size_t> widths;
};

std::size_t width_of(const Block& block) {
  std::size_t total = block.widths.empty() ? 0 : kGap * (block.widths.size() - 1);
  for (const std::size_t width : block.widths) total += width;
  return total;
}

std::vector<std::size_t> natural_widths(const Table& table) {
  std::vector<std::size_t> widths;
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    std::size_t width = display_width(table.columns[c].header);
    for (const auto& row : table.rows) width = std::max(width, display_width(row[c]));
    widths.push_back(width);
  }
  return widths;
}

/// The columns in front that name a row: those with words, two at most, not all.
std::size_t naming_columns(const Table& table) {
  std::size_t count = 0;
  while (count < 2 && count + 1 < table.columns.size() &&
         table.columns[count].align == Align::kLeft) {
    ++count;
  }
  return count;
}

std::vector<Block> blocks_of(const Table& table, std::size_t limit) {
  const auto widths = natural_widths(table);
  Block whole;
  for (std::size_t c = 0; c < widths.size(); ++c) {
    whole.columns.push_back(c);
    whole.widths.push_back(widths[c]);
  }
  if (limit == 0 || width_of(whole) <= limit) return {whole};
  Block naming;
  for (std::size_t c = 0; c < naming_columns(table); ++c) {
    naming.columns.push_back(c);
    naming.widths.push_back(widths[c]);
  }
  std::vector<Block> blocks;
  Block block = naming;
  for (std::size_t c = naming.columns.size(); c < widths.size(); ++c) {
    const bool has_some = block.columns.size() > naming.columns.size();
    if (has_some && width_of(block) + kGap + widths[c] > limit) {
      blocks.push_back(std::exchange(block, naming));
    }
    block.columns.push_back(c);
    const std::size_t before = width_of(naming) + (naming.columns.empty() ? 0 : kGap);
    const std::size_t room = std::max(kLeastWidth, limit > before ? limit - before : 0);
    block.widths.push_back(std::min(widths[c], room));
  }
  blocks.push_back(std::move(block));
  return blocks;
}

/// A row takes as many lines as its longest cell.
std::string text_row(const Table& table, const Block& block,
                     const std::vector<std::string>& cells) {
  std::vector<std::vector<std::string>> lines;
  std::size_t height = 1;
  for (std::size_t i = 0; i < block.columns.size(); ++i) {
    const std::string& cell = cells[block.columns[i]];
    lines.push_back(display_width(cell) > block.widths[i] ? wrapped(cell, block.widths[i])
                                                          : std::vector<std::string>{cell});
    height = std::max(height, lines.back().size());
  }
  std::string out;
  for (std::size_t line = 0; line < height; ++line) {
    std::string text;
    for (std::size_t i = 0; i < block.columns.size(); ++i) {
      if (i != 0) text += std::string(kGap, ' ');
      text += pad(line < lines[i].size() ? lines[i][line] : "", block.widths[i],
                  table.columns[block.columns[i]].align);
    }
    out += trim_right(std::move(text)) + "\n";
  }
  return out;
}

std::string rule_of(const Block& block) {
  std::string rule;
  for (std::size_t i = 0; i < width_of(block); ++i) rule += "─";
  return rule + "\n";
}

}  // namespace

std::vector<std::string> wrapped(std::string_view text, std::size_t columns) {
  if (columns == 0) return {std::string(text)};
  std::vector<std::string> lines;
  std::string line;
  for (const auto& word : split(std::string(text), ' ')) {
    if (!line.empty() && display_width(line) + 1 + display_width(word) > columns) {
      lines.push_back(std::exchange(line, ""));
    }
    line += (line.empty() ? "" : " ") + word;
  }
  lines.push_back(std::move(line));
  return lines;
}

std::string text_table(const Table& table, std::size_t columns) {
  std::vector<std::string> headers;
  for (const auto& column : table.columns) headers.push_back(column.header);
  const auto blocks = blocks_of(table, columns);
  std::string out;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const auto part =
        blocks.size() == 1 ? std::string() : fmt::format(" ({} of {})", b + 1, blocks.size());
    for (const auto& line : wrapped(table.title + part, columns)) out += line + "\n";
    out += text_row(table, blocks[b], headers) + rule_of(blocks[b]);
    for (const auto& row : table.rows) out += text_row(table, blocks[b], row);
    if (b + 1 < blocks.size()) out += "\n";
  }
  for (const auto& note : table.footnotes) {
    for (const auto& line : wrapped(note, columns)) out += line + "\n";
  }
  if (!table.origin.empty()) {
    for (const auto& line : wrapped("From: " + table.origin, columns)) out += line + "\n";
  }
  return out;
}

}  // namespace pirt
