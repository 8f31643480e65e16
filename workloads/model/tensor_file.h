// Tensors in a raw file: how one process hands a workload's reference, and its inputs, to another
// on the same machine.
//
// A scratch format, not an archive: the byte order is the machine's, and the reader must know the
// specs.
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "workloads/model/tensor.h"
#include "workloads/model/workload.h"

namespace pirt {

/// Writes a whole file or none (a temporary file beside it, then rename).
/// @throws Error{kBadInput} naming the path and the system's reason.
void write_tensors(const std::filesystem::path& path, std::span<const Tensor> tensors);
void write_tensors(const std::filesystem::path& path, std::span<const Tensor* const> tensors);

/// @throws Error{kBadInput} if the file is missing, of another size than @p specs say, or its
/// content does not match its hash.
[[nodiscard]] std::vector<Tensor> read_tensors(const std::filesystem::path& path,
                                               std::span<const TensorSpec> specs);

/// The specs of what Workload::reference returns: the outputs', with floating point as f64.
[[nodiscard]] std::vector<TensorSpec> reference_specs(const Workload& workload);

/// What reference_of() gives for a whole sequence.
/// @throws Error{kBadInput} as write_tensors and read_tensors.
void write_reference(const std::filesystem::path& path, std::vector<std::vector<Tensor>> sequence);
[[nodiscard]] std::vector<std::vector<Tensor>> read_reference(const std::filesystem::path& path,
                                                              const Workload& workload);

/// What make_sequence() gives, its notes and the state before it in files beside it. Whoever sees
/// the file sees all.
/// @param state  Empty for workloads without one.
/// @throws Error{kBadInput} as write_tensors and read_tensors.
void write_data(const std::filesystem::path& path, std::span<const Data> frames,
                std::span<const Tensor> state);
[[nodiscard]] std::vector<Data> read_data(const std::filesystem::path& path,
                                          const Workload& workload);
/// The state that stands beside them; nothing for workloads without one.
[[nodiscard]] std::vector<Tensor> read_state(const std::filesystem::path& path,
                                             const Workload& workload);

}  // namespace pirt
