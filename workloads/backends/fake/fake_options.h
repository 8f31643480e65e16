// What a platform file may say of a unit of backend fake.
#pragma once

#include <vector>

#include "workloads/model/backend.h"

namespace pirt {

/// In the order in which fake_backend.cpp reads them.
[[nodiscard]] inline std::vector<OptionSpec> fake_options() {
  return {{"slowdown", "", "all simulated times of calls, times this", 1e-3, 1e3, 1.0}};
}

}  // namespace pirt
