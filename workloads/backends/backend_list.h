// What a platform file may say of backends, whether or not there is one to compute with: their
// names and options.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "workloads/model/backend.h"

namespace pirt {

[[nodiscard]] std::vector<std::string> backend_names();
/// What a platform file may give under a unit's `options:`, and a device reads from its request.
/// All of them change figures. Nothing for a name that is no backend's.
[[nodiscard]] std::vector<OptionSpec> options_of(std::string_view backend);
/// Whether its kernels can be left between two slices (model/slices.h).
[[nodiscard]] bool leaves_calls_of(std::string_view backend);
/// Keys of a unit whose values are texts for its backend, which gets a map of them as its request's
/// script. They say where it is, and change no figures by themselves.
[[nodiscard]] std::vector<std::string> settings_of(std::string_view backend);
/// Why a setting or an option that there was is there no more; empty for others.
[[nodiscard]] std::string gone_setting(std::string_view key);

}  // namespace pirt
