#include "cli/options/profile_platform.h"

#include <algorithm>
#include <utility>

#include "characterize/profile/store/reader.h"
#include "cli/options/own.h"
#include "scheduler/services/devices.h"
#include "workloads/base/error.h"

namespace pirt::cli {

Platform platform_of(const Profile& profile, const std::vector<YamlOverride>& overrides) {
  const std::string& name = profile.platform();
  const auto shipped = shipped_platforms();
  if (std::ranges::find(shipped, name) == shipped.end()) {
    throw_bad_input("profile '" + profile.path + "' was taken on platform " + name +
                    ", which is not shipped; give its file with --platform FILE.yaml");
  }
  return load_platform(name, overrides);
}

ProfiledPlatform read_platform(const std::optional<std::string>& platform,
                               const std::optional<std::string>& profile,
                               const std::vector<YamlOverride>& overrides,
                               const std::vector<std::string>& own) {
  ProfiledPlatform read;
  if (platform) read.platform = load_platform(*platform, overrides);
  if (profile) read.profile = ProfileReader(*profile).read(read.platform.name);
  if (!platform) read.platform = platform_of(read.profile.value(), overrides);
  read.platform = on_devices(std::move(read.platform), read.profile ? &*read.profile : nullptr);
  if (read.profile) doubt_rows(*read.profile, own);
  return read;
}

}  // namespace pirt::cli
