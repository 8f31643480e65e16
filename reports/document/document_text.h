// Tables and paragraphs as text for a terminal, folded where they are too wide for it.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "reports/document/table.h"

namespace pirt {

/// @param columns  Of the terminal; 0 = no limit. A table that is wider becomes several, one below
/// the other, each with the first columns that name its rows; what is too wide alone is wrapped.
[[nodiscard]] std::string text_table(const Table& table, std::size_t columns);

/// @p text in lines of at most @p columns, broken between words; 0 = one line.
[[nodiscard]] std::vector<std::string> wrapped(std::string_view text, std::size_t columns);

}  // namespace pirt
