// Small text helpers shared by all folders: nearest names for error messages, joining, file
// reading.
#pragma once

#include <cstdint>
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
/// What stands between blanks, tabs and ends of lines.
[[nodiscard]] std::vector<std::string> words_in(std::string_view text);

/// Whether @p text has letters and digits of ASCII, @p others and nothing else.
[[nodiscard]] bool is_made_of(std::string_view text, std::string_view others);

/// What a mix, a platform or a result of a run stays far below; more is not a file of ours.
inline constexpr std::size_t kMaxInputBytes = std::size_t{64} << 20;
/// For files that grow with what was measured or run.
inline constexpr std::size_t kAnySize = SIZE_MAX;

/// The whole file. A pipe that the user names (`/dev/stdin`, `<(...)`, a FIFO) is read to its end;
/// a signal ends the wait for it, even if the program handles that signal.
/// @throws Error{kBadInput} naming the path and the system's reason; folders and devices other than
/// a terminal (/dev/zero has no end) are refused, and what is longer than @p max_bytes.
[[nodiscard]] std::string read_file(const std::filesystem::path& path,
                                    std::size_t max_bytes = kMaxInputBytes);
/// The same of text: without a byte order mark, and lines end in '\n' alone.
/// @throws Error{kBadInput} also for UTF-16.
[[nodiscard]] std::string read_text(const std::filesystem::path& path,
                                    std::size_t max_bytes = kMaxInputBytes);
/// For readers that open a file themselves. read_file() has asked.
/// @throws Error{kBadInput} if its first bytes are those of what stands in a file's place: a
/// pointer of Git LFS or git-annex, a web page. With the remedy.
void refuse_pointer(const std::filesystem::path& path, std::string_view head);

/// What opening @p path for writing would open: where it is a link, what that leads to, even if
/// nothing is there yet.
[[nodiscard]] std::filesystem::path follow_links(std::filesystem::path path);

/// Writes a whole file or leaves the old one: a temporary file beside it, then rename. Links stay.
/// @throws Error{kBadInput} naming the path and the system's reason.
void write_file(const std::filesystem::path& path, std::string_view text);

/// Before long work: whether write_file() could begin. Leaves everything as it was; pipes and
/// devices are not tried.
/// @throws Error{kBadInput} as write_file().
void check_writable(const std::filesystem::path& path);

}  // namespace pirt
