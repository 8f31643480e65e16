// What --platform and --profile name: either may name the other.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"

namespace pirt::cli {

/// @throws Error{kBadInput} if it is none that is shipped: then it came from a file, which has to
/// be given.
[[nodiscard]] Platform platform_of(const Profile& profile,
                                   const std::vector<YamlOverride>& overrides = {});

struct ProfiledPlatform {
  Platform platform;
  std::optional<Profile> profile;
};
/// The platform is on the devices that the profile names (on_devices).
/// @param platform  A name or a file; absent = the profile's.
/// @param profile   A profile database; absent = none, and then there is a platform.
/// @throws Error{kBadInput} as load_platform, ProfileReader::read and platform_of.
/// @param own       Files of workloads of one's own: rows are doubted (own.h) whose are not what
/// they were.
[[nodiscard]] ProfiledPlatform read_platform(const std::optional<std::string>& platform,
                                             const std::optional<std::string>& profile,
                                             const std::vector<YamlOverride>& overrides,
                                             const std::vector<std::string>& own = {});

}  // namespace pirt::cli
