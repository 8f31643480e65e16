// What stands in the registry for a backend that this build is without.
#pragma once

#include <memory>
#include <string>

#include "workloads/model/backend.h"

namespace pirt {

/// Has no device and supports nothing.
/// @param missing  What was not there when pirt was built, and the remedy, in one line.
[[nodiscard]] std::unique_ptr<const Backend> make_missing_backend(std::string name,
                                                                  std::string missing);
[[nodiscard]] bool is_missing(const Backend& backend);

}  // namespace pirt
