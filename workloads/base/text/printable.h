// Text from outside (files, arguments, file names) that is shown to people: what may enter as a
// name, and how the rest is shown, so that no terminal takes it for commands.
//
// Printable is well-formed UTF-8 without control characters: C0 (newline, escape, ...), DEL and C1,
// which terminals obey too, and without what breaks lines or turns their direction, behind which a
// name could look like another (Unicode Technical Report 36, bidirectional spoofing).
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace pirt {

struct Unprintable {
  std::size_t at = 0;  ///< Bytes before it.
  std::string what;    ///< "the control character \x1b", "the byte \xff, which is not UTF-8".
};

/// The first place where @p text is not printable; none = it all is.
/// @param allowed  Control characters that are good there, e.g. "\n\t".
[[nodiscard]] std::optional<Unprintable> find_unprintable(std::string_view text,
                                                          std::string_view allowed = "");

/// @p text with what is not printable as escapes: `\n`, `\t`, `\r`, otherwise `\x1b` for each byte.
/// @param allowed  Control characters that stay as they are.
[[nodiscard]] std::string printable(std::string_view text, std::string_view allowed = "");

}  // namespace pirt
