// Commands that somebody types as they are printed.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace pirt {

/// The word as a POSIX shell takes it for one: as it is, or in single quotes.
[[nodiscard]] std::string in_shell(std::string_view word);
/// A path, which is no option even if it begins with a dash.
[[nodiscard]] std::string path_in_shell(std::string_view path);

/// The words of @p command as a POSIX shell splits them: blanks, single and double quotes,
/// backslash. No shell runs: nothing is expanded.
/// @throws Error{kBadInput}: no word, a quote without its end, or an unquoted character that only a
/// shell understands (| & ; < > ( ) $ ` * ? [, ~ and # before a word), with the remedy.
[[nodiscard]] std::vector<std::string> shell_words(std::string_view command);

}  // namespace pirt
