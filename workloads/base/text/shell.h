// Commands that somebody types as they are printed.
#pragma once

#include <string>
#include <string_view>

namespace pirt {

/// The word as a POSIX shell takes it for one: as it is, or in single quotes.
[[nodiscard]] std::string in_shell(std::string_view word);
/// A path, which is no option even if it begins with a dash.
[[nodiscard]] std::string path_in_shell(std::string_view path);

}  // namespace pirt
