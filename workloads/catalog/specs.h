// What the workloads of the catalog take and make, for whoever computes none of them: a scheduler
// in virtual time needs no library that does.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/model/tensor.h"
#include "workloads/model/workload.h"

namespace pirt {

/// As Workload; refers to what stays to the end of the process.
struct WorkloadSpec {
  const std::string& name;
  const std::vector<TensorSpec>& inputs;
  const std::vector<TensorSpec>& outputs;
  const std::optional<StateSpec>& state;
  std::optional<std::int64_t> ops;
  std::int64_t bytes = 0;
};

/// In the catalog's order, without variants and batches.
[[nodiscard]] std::vector<std::string> workload_names();
/// Of the catalog, a variant or a batch; absent if there is none of that name.
[[nodiscard]] std::optional<WorkloadSpec> try_find_spec(std::string_view name);
/// @throws Error{kBadInput} with the nearest names.
[[nodiscard]] WorkloadSpec find_spec(std::string_view name);

}  // namespace pirt
