// Which cells the time that is left is for.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

/// Of cells that are not as precise as wished, those that get the next processes, so that as many
/// as possible become so: those that need the least time for it, as far as @p left goes. All of
/// them if it goes for none: then each becomes a little more precise.
/// @param needed  Time that each is expected to need; absent = more than it will ever get.
/// @return Positions in @p needed, in ascending order.
[[nodiscard]] std::vector<std::size_t> within_reach(std::span<const std::optional<Nanos>> needed,
                                                    Nanos left);

}  // namespace pirt
