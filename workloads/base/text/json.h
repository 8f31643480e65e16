// JSON as text. Reading and writing it is compiled in one place, since each file that does it with
// the library's templates takes seconds more.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace pirt {

/// Keys stay in the order in which they were written.
using Json = nlohmann::ordered_json;

/// @throws nlohmann::json::exception if it is none.
[[nodiscard]] Json parse_json(std::string_view text);
/// A discarded value if it is none.
[[nodiscard]] Json parse_json_or_discard(std::string_view text);
/// Without a newline at the end. File names need not be UTF-8, and JSON has to be: their other
/// bytes become U+FFFD.
/// @param indent  Spaces a level; -1 = all on one line.
[[nodiscard]] std::string json_text(const Json& json, int indent = -1);

}  // namespace pirt
