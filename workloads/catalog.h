// All workloads, in the order that tables show them: Table I first, then the pools, then the chain.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/workload.h"

namespace pirt {

[[nodiscard]] std::span<const Workload> catalog();
[[nodiscard]] std::vector<std::string> workload_names();

/// Null if there is none of that name.
[[nodiscard]] const Workload* try_find_workload(std::string_view name);
/// @throws Error{kBadInput} with the nearest names.
[[nodiscard]] const Workload& find_workload(std::string_view name);

}  // namespace pirt
