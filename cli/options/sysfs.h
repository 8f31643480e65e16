// Where sysfs is mounted, for the commands that read energy meters.
#pragma once

#include <filesystem>

namespace pirt::cli {

/// /sys, or the folder that the environment variable PIRT_SYSFS names: tests run the program on
/// recorded trees, and a container may have the host's sysfs elsewhere.
[[nodiscard]] std::filesystem::path sysfs_root();

}  // namespace pirt::cli
