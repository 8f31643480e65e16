// Which cores a unit of a platform file gets: parts of a machine are made of whole physical cores.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/platform/platform.h"
#include "workloads/base/system/cores.h"

namespace pirt {

/// "all", "first_half", "second_half", "all_but_two", "last_two".
[[nodiscard]] const std::vector<std::string>& core_parts();

/// The logical cores of one of core_parts(), rising. Halves are of physical cores, the odd one in
/// the first; where these are of two kinds, each half is one kind, the faster the first, and where
/// they are of more, the faster ones come first. The last two are physical cores, too; of fewer
/// than four, these parts are the halves. Threads of a single physical core are taken for cores; a
/// single thread is in all parts.
/// @param machine  At least one.
[[nodiscard]] std::vector<int> cores_of_part(std::string_view part,
                                             std::span<const PhysicalCore> machine);

/// What a reader of figures has to know of the units' cores, one thing a line: that units are
/// threads of one physical core; that a unit's cores, or those of two units, are of several kinds.
[[nodiscard]] std::vector<std::string> core_remarks(const Platform& platform,
                                                    std::span<const PhysicalCore> machine);

}  // namespace pirt
