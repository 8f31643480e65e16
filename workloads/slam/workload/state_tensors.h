// The SLAM's state as tensors: what a workload's named state holds from call to call.
#pragma once

#include <span>
#include <vector>

#include "workloads/model/tensor.h"
#include "workloads/slam/filter/state.h"

namespace pirt::slam {

/// Lists with room for all that a run of @p setup can have: numbers f64 [<=n], integers i32 [<=n,2]
/// (low and high word), descriptors u8 [<=n,32]. In the order of the members of State, each vector
/// after its length.
[[nodiscard]] std::vector<TensorSpec> state_specs(const Setup& setup);

/// @throws Error{kBadInput} if the state has more of something than there is room for.
void write_state(const State& state, std::span<Tensor> tensors);

/// Bit for bit what was written.
/// @throws Error{kBadInput} if that is no state: lengths that do not fit the rows.
[[nodiscard]] State read_state(std::span<const Tensor> tensors);

}  // namespace pirt::slam
