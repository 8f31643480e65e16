// Text within HTML, SVG and XML.
#pragma once

#include <string>
#include <string_view>

namespace pirt {

/// "a < b" -> "a &lt; b": nothing in it is markup any more, as content or as an attribute's value.
/// A newline stays one; other control characters, which XML 1.0 cannot write, become spaces.
[[nodiscard]] std::string escape_markup(std::string_view text);

}  // namespace pirt
