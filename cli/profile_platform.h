// The platform of a profile, where no --platform names one.
#pragma once

#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"

namespace pirt::cli {

/// @throws Error{kBadInput} if it is none that is shipped: then it came from a file, which has to
/// be given.
[[nodiscard]] Platform platform_of(const Profile& profile,
                                   const std::vector<YamlOverride>& overrides = {});

}  // namespace pirt::cli
