// What a platform file may say of backends, whether or not there is one to compute with: their
// names and options.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "workloads/backend.h"

namespace pirt {

[[nodiscard]] std::vector<std::string> backend_names();
/// As Backend::options; nothing for a name that is no backend's.
[[nodiscard]] std::vector<OptionSpec> options_of(std::string_view backend);

}  // namespace pirt
