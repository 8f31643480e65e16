// The part of pirt characterize that measures what units take beside their calls.
#pragma once

#include <filesystem>

#include "characterize/profile/profile.h"

namespace pirt::cli {

/// Adds rows of every UnitPhase to the newest run of @p profile, for its units that are threads of
/// the host: those whose device computes on the host's cores. Calls are left on backend cpu alone.
void measure_unit_times(const std::filesystem::path& database, const Profile& profile);

}  // namespace pirt::cli
