// A table of a document: printed cells, and what has to be said about them.
#pragma once

#include <cstdint>
#include <string>
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
  /// Where its figures come from, with the command that makes them; empty = said elsewhere.
  std::string origin = {};
};

}  // namespace pirt
