// The control groups of this process, and what they leave it of the machine's memory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

namespace pirt {

/// Where a controller's files of this process' control group may lie, in the unified hierarchy (v2)
/// or that of the controller (v1): the process' own group, then all groups around it up to the
/// root, which is the container's own group where one is seen from inside.
/// @param controller  "cpu", "memory".
[[nodiscard]] std::vector<std::filesystem::path> control_groups(const std::filesystem::path& root,
                                                                std::string_view controller);

/// What this process' control groups leave it of memory, the least of them; absent without a limit.
/// @source Documentation/admin-guide/cgroup-v2 (memory.max), cgroup-v1/memory.
[[nodiscard]] std::optional<std::int64_t> memory_limit_bytes(
    const std::filesystem::path& root = "/");
/// What a measurement may fill for itself: an eighth of that, or of all that this machine has.
[[nodiscard]] std::int64_t most_filled_bytes(const std::filesystem::path& root = "/");

}  // namespace pirt
