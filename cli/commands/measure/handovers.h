// The part of pirt characterize that hands calls to units with the runtime's own queue.
#pragma once

#include <filesystem>

#include "characterize/profile/profile.h"

namespace pirt::cli {

/// Adds rows of hand-overs to the newest run of @p profile, for its units that are threads of the
/// host: those whose device computes on the host's cores.
void measure_handovers(const std::filesystem::path& database, const Profile& profile);

}  // namespace pirt::cli
