// Reading single attributes of sysfs. Whatever goes wrong is data, since a meter that fails must
// not end a run.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace pirt {

/// What reading an attribute gave: a value, or why there is none.
template <typename T>
struct Attribute {
  std::optional<T> value;
  std::string error;  ///< "/sys/.../energy_uj: Input/output error"; empty with a value.
  int code = 0;       ///< errno of the failure; 0 = none, or the text is not what was expected.
};

/// The attribute's text without the white space around it. Never waits: a pipe in place of a file
/// is an error. Reads that are refused for a moment (EIO on a busy bus, EAGAIN) are tried 3 times.
[[nodiscard]] Attribute<std::string> read_text(const std::filesystem::path& path);

/// A decimal number, with a sign or without.
[[nodiscard]] Attribute<std::int64_t> read_integer(const std::filesystem::path& path);

/// The text, or "" where there is none.
[[nodiscard]] std::string text_or_empty(const std::filesystem::path& path);

/// Entries of a folder by name; empty if it cannot be listed.
[[nodiscard]] std::vector<std::filesystem::path> folder_entries(
    const std::filesystem::path& folder);

}  // namespace pirt
