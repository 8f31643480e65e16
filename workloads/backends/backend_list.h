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

}  // namespace pirt
