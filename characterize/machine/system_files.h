// Small readers of the text files under /proc and /sys. What goes wrong is data, never an error:
// which file a kernel offers depends on the machine, and a meter that fails must not end a run.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
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
[[nodiscard]] Attribute<std::string> read_attribute(const std::filesystem::path& path);

/// A decimal number, with a sign or without.
[[nodiscard]] Attribute<std::int64_t> read_integer(const std::filesystem::path& path);

/// The text, or "" where there is none.
[[nodiscard]] std::string text_or_empty(const std::filesystem::path& path);

/// Entries of a folder by name; empty if it cannot be listed.
[[nodiscard]] std::vector<std::filesystem::path> folder_entries(
    const std::filesystem::path& folder);

/// Without blanks, tabs and quotes at either end.
[[nodiscard]] std::string trimmed(std::string_view text);

/// The first line without blanks and zero bytes at its end; absent if the file cannot be read.
[[nodiscard]] std::optional<std::string> first_line(const std::filesystem::path& path);

/// The integer that the file begins with.
[[nodiscard]] std::optional<std::int64_t> read_number(const std::filesystem::path& path);

/// The value of the first line "key <separator> value".
[[nodiscard]] std::optional<std::string> value_of(const std::filesystem::path& path,
                                                  std::string_view key, char separator);

/// The same as an integer, whatever unit follows it ("MemTotal:  2097152 kB").
[[nodiscard]] std::optional<std::int64_t> number_of(const std::filesystem::path& path,
                                                    std::string_view key, char separator);

/// The numbers N of the folders "<prefix>N" in @p folder, in order ("cpu" -> 0, 1, ...).
[[nodiscard]] std::vector<int> numbered_folders(const std::filesystem::path& folder,
                                                std::string_view prefix);

}  // namespace pirt
