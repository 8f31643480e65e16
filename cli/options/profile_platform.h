// What --platform and --profile name: either may name the other.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "cli/options/command.h"
#include "scheduler/mix/mix.h"

namespace pirt::cli {

/// Of figures that were imported for a platform that is not shipped, one with their units.
/// @throws Error{kBadInput} if it is neither: then it came from a file, which has to be given.
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
/// @param mix       As --mix, whose workloads are looked for in those files where the profile does
/// not have them; empty = there is none.
[[nodiscard]] ProfiledPlatform read_platform(const std::optional<std::string>& platform,
                                             const std::optional<std::string>& profile,
                                             const std::vector<YamlOverride>& overrides,
                                             const std::vector<std::string>& own = {},
                                             const std::string& mix = "");

/// --estimate
void add_estimate_option(Command& command, bool& estimate);
/// Of workloads NAME@WIDTHxHEIGHT of the mix that the profile has no rows of on some unit, but of
/// other sizes: says so with the command that measures them, or, with @p estimate, adds rows of a
/// model where it can (profile/size_estimate.h) and says what they are.
/// @throws Error{kBadInput} if no other unit serves one, or if somebody else's has no other sizes.
void fill_sizes(ProfiledPlatform& read, const Mix& mix, bool estimate);

}  // namespace pirt::cli
