// The backend's table: from a workload to a command of the Hexagon program.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/backends/dsp/session.h"
#include "workloads/model/backend.h"

namespace pirt::dsp {

/// Where a tensor lies in the mapping, in rows.
struct MappedTensor {
  Buffer buffer;
  std::size_t rows = 1;
  std::size_t row_bytes = 0;
  std::size_t pitch_bytes = 0;
};

/// A call of a kernel, ready to be made.
struct Call {
  std::uint32_t kernel = 0;
  std::string name;
  std::vector<Buffer> buffers;
  std::vector<Buffer> loaded = {};  ///< Of these, what make() has filled: weights, a map.
  std::vector<std::int32_t> values;
  std::vector<MappedTensor> inputs, outputs;  ///< In the order of the workload's tensors.
  /// i32: how many rows an output that varies has; all outputs that vary have as many.
  std::optional<MappedTensor> rows = {};
};

struct DspKernelEntry {
  std::string_view kernel;  ///< Workload::kernel
  /// Why it cannot compute this one; empty if it can.
  std::string (*fault)(const Workload& workload);
  Call (*make)(ProgramSession& session, const Workload& workload,
               std::span<const Tensor> parameters);
};

[[nodiscard]] std::span<const DspKernelEntry> vision_kernels();
[[nodiscard]] std::span<const DspKernelEntry> dnn_kernels();
/// The entry for Workload::kernel; null if there is none.
[[nodiscard]] const DspKernelEntry* find_kernel(std::string_view kernel);
[[nodiscard]] Call make_undistort(ProgramSession& session, const Workload& workload,
                                  std::span<const Tensor> parameters);

/// Room for a tensor [rows, columns, ...] each of whose rows has room for a multiple of 128
/// columns: rows of any element begin with a vector, and strips of as many columns end within them.
[[nodiscard]] MappedTensor make_picture(ProgramSession& session, const TensorSpec& tensor);
/// Room for any tensor, as it is.
[[nodiscard]] MappedTensor make_dense(ProgramSession& session, const TensorSpec& tensor);

/// Makes a call on what is resident.
Cost run(ProgramSession& session, const Call& call);

void copy_in(ProgramSession& session, const MappedTensor& to, std::span<const std::byte> from);
void copy_out(const ProgramSession& session, const MappedTensor& from, std::span<std::byte> to);

}  // namespace pirt::dsp
