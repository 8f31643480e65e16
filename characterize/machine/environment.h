// What is known of the machine and the build when something is measured. environment_keys.h says
// what of it must match for two runs to be compared.
//
// A fact that cannot be known has no key, but a key "<fact>_unknown" with the reason: never an
// empty text or a made-up value.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "characterize/machine/environment_keys.h"
#include "characterize/machine/host_load.h"

namespace pirt {

using Environment = std::map<std::string, std::string>;

/// Whether cores may clock higher than they can for long.
struct Turbo {
  bool on = false;
  std::string remedy;  ///< The command that turns it off.
};
/// Absent where the kernel does not say.
[[nodiscard]] std::optional<Turbo> read_turbo(const std::filesystem::path& root);

/// What environment_keys.h lists of the machine, as it is now.
/// @param root  Where /proc, /sys and /etc are found; another folder in tests.
[[nodiscard]] Environment host_environment(const std::filesystem::path& root = "/");

/// What a run adds when it ends: load and temperature then, steal, throttling and heat meanwhile.
/// @param before, after  Of all cores, at the run's begin and end.
[[nodiscard]] Environment end_environment(const HostCounters& before, const HostCounters& after,
                                          const std::filesystem::path& root = "/");

/// pirt_version, compiler, compiler_flags, build_type, sanitizers, git_commit, git_dirty, versions
/// of libraries that are linked here.
[[nodiscard]] Environment build_environment();

}  // namespace pirt
