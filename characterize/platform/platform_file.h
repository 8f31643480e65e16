// From the YAML of a platform file to a Platform; the inside of platform.cpp.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "workloads/base/system/cores.h"

namespace pirt {

/// Keys that stand beside unit names in a workload's entry, and so cannot be units.
[[nodiscard]] const std::vector<std::string>& workload_keys();

/// @param machine  The cores that "all", the halves, "all_but_two" and "last_two" are taken of; at
/// least one.
/// @throws Error{kBadInput} with file:line.
[[nodiscard]] Platform read_platform(const YamlNode& document,
                                     std::span<const PhysicalCore> machine);

}  // namespace pirt
