// The part of pirt characterize that measures what units take beside their calls.
#pragma once

#include <vector>

#include "characterize/campaign/unit_times.h"
#include "characterize/profile/profile.h"

namespace pirt::cli {

/// Rows of every UnitPhase for a unit that is threads of the host: one whose device computes on the
/// host's cores. Calls are left on backend cpu alone. None for others.
[[nodiscard]] std::vector<UnitTimePart> unit_time_parts(const UnitRecord& unit);

}  // namespace pirt::cli
