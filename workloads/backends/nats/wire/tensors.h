// How tensors travel, and what it is that they are of. They are read by the specs of a workload
// that the reader knows: their sizes never come from the wire, and their values are in the specs'
// ranges.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "workloads/backends/nats/wire/wire.h"
#include "workloads/model/workload.h"

namespace pirt::cloud {

/// The rows that they have.
[[nodiscard]] Bytes encode_tensors(std::span<const Tensor> tensors);
/// At most so many bytes encode_tensors makes of these; fewer only where lists are not full.
[[nodiscard]] std::uint64_t encoded_bytes(std::span<const TensorSpec> specs);
/// @param specs  Of the tensors that are expected: all others are a problem, and so are values out
///               of their ranges, and numbers that are none.
[[nodiscard]] Decoded<std::vector<Tensor>> decode_tensors(ByteView bytes,
                                                          std::span<const TensorSpec> specs);
/// Into tensors that are there. @return  The problem; the tensors are as they were then.
[[nodiscard]] std::string decode_tensors_into(ByteView bytes, std::span<Tensor> tensors);

/// Of all that has to be the same for two programs to mean the same computation: kernel, variant,
/// precision, batch, the specs of its tensors, and a user's models.
[[nodiscard]] Digest spec_digest(const Workload& workload);

}  // namespace pirt::cloud
