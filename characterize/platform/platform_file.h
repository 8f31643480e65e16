// From the YAML of a platform file to a Platform; the inside of platform.cpp.
#pragma once

#include <span>

#include "characterize/platform/platform.h"
#include "workloads/base/system/cores.h"

namespace pirt {

/// @param machine  The cores that "all", the halves, "all_but_two" and "last_two" are taken of; at
/// least one.
/// @throws Error{kBadInput} with file:line.
[[nodiscard]] Platform read_platform(const YamlNode& document,
                                     std::span<const PhysicalCore> machine);

}  // namespace pirt
