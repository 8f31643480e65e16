// Small text helpers shared by all folders: nearest names for error messages, joining, file
// reading.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pirt {

/// The candidates closest to @p word by edit distance, best first; at most @p limit, none farther
/// than half the word.
[[nodiscard]] std::vector<std::string> nearest(std::string_view word,
                                               std::span<const std::string> candidates,
                                               std::size_t limit = 3);

/// " (did you mean a, b?)", or the whole list if nothing is near and it is short, or "".
[[nodiscard]] std::string suggestion(std::string_view word,
                                     std::span<const std::string> candidates);

[[nodiscard]] std::string join(std::span<const std::string> parts, std::string_view separator);
[[nodiscard]] std::vector<std::string> split(std::string_view text, char separator);

/// @throws Error{kBadInput} naming the path and the system's reason.
[[nodiscard]] std::string read_file(const std::filesystem::path& path);

/// Writes a whole file or leaves the old one: a temporary file beside it, then rename.
/// @throws Error{kBadInput} naming the path and the system's reason.
void write_file(const std::filesystem::path& path, std::string_view text);

}  // namespace pirt
