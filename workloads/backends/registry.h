// All backends of this build (backends.inc).
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "workloads/model/backend.h"

namespace pirt {

[[nodiscard]] std::span<const std::unique_ptr<const Backend>> backends();

/// @throws Error{kBadInput} with the nearest names.
[[nodiscard]] const Backend& find_backend(std::string_view name);

}  // namespace pirt
