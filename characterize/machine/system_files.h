// Small readers of the text files under /proc and /sys. What is not there or not as documented is
// absent, never an error: which file a kernel offers depends on the machine.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace pirt {

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

/// The logical cores of the physical core that @p core is on; itself alone where the kernel does
/// not say.
/// @param root  "/", or the folder of a recorded machine.
/// @source Documentation/admin-guide/cputopology: thread_siblings_list, as "0-1,4".
[[nodiscard]] std::set<int> core_siblings(const std::filesystem::path& root, int core);

/// Where a controller's files of this process' control group may lie, in the unified hierarchy (v2)
/// or that of the controller (v1): the process' own group, then all groups around it up to the
/// root, which is the container's own group where one is seen from inside.
/// @param controller  "cpu", "memory".
[[nodiscard]] std::vector<std::filesystem::path> control_groups(const std::filesystem::path& root,
                                                                std::string_view controller);

}  // namespace pirt
