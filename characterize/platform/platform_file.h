// From the YAML of a platform file to a Platform; the inside of platform.cpp.
#pragma once

#include <vector>

#include "characterize/platform/platform.h"

namespace pirt {

/// @param usable  The machine's cores that "all", the halves, "all_but_two" and "last_two" are
/// taken of; at least one.
/// @throws Error{kBadInput} with file:line.
[[nodiscard]] Platform read_platform(const YamlNode& document, const std::vector<int>& usable);

}  // namespace pirt
