// A platform on the devices that its units turned out to have: what the profile says of their power
// where the platform file says nothing that is true of them.
#pragma once

#include <span>
#include <string>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"

namespace pirt {

/// on_device of each unit that the profile has, and of a GPU whose power nobody stated that of its
/// meter: standing_power. Done twice, it changes nothing.
/// @param profile  Null = the devices are not known, and the platform is as it was.
/// @param without  Units that the run leaves out, whose devices it does not hold open.
[[nodiscard]] Platform on_devices(Platform platform, const Profile* profile,
                                  std::span<const std::string> without = {});

}  // namespace pirt
