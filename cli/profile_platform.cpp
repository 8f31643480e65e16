#include "cli/profile_platform.h"

#include <algorithm>

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

}  // namespace pirt::cli
