// The backend's table: from a workload to what goes through a core.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/model/backend.h"
#include "workloads/model/tensor.h"

namespace pirt::fpga {

/// Elements that a core reads in order.
struct InLane {
  int bytes = 1;  ///< Of an element.
  /// Of the board, as long as the core reads; what is there from `prepare` on is filled in.
  std::vector<std::byte> memory;
  std::size_t call_bytes = 0;    ///< Moved there by each call, at its begin.
  std::size_t loaded_bytes = 0;  ///< Moved there by `prepare`.
};
struct OutLane {
  int bytes = 1;
  std::size_t size_bytes = 0;
};

/// A workload as a core computes it.
struct Call {
  std::string_view core;
  int width = 0, height = 0;  ///< Of a core for pictures.
  std::vector<std::uint8_t> parameters = {};
  std::vector<InLane> in = {};
  std::vector<OutLane> out = {};
  /// What each call puts into the lanes, where that is not an input a lane.
  /// @return cycles of a host's core for it: modelled.
  std::function<double(std::span<const Tensor> inputs, std::vector<InLane>& lanes)> fill = {};
  /// Makes the workload's outputs of the lanes, where that is not an output a lane.
  /// @return as fill.
  std::function<double(std::span<const std::vector<std::byte>> lanes, std::span<Tensor> outputs)>
      finish = {};
};

struct FpgaKernelEntry {
  std::string_view kernel;     ///< Workload::kernel
  std::string_view core;       ///< Of cores/.
  std::string_view bitstream;  ///< Which has the core, beside others.
  /// Why it cannot compute this one; empty if it can.
  std::string (*fault)(const FpgaKernelEntry& entry, const Workload& workload);
  Call (*make)(const Workload& workload, std::span<const Tensor> parameters);
};

[[nodiscard]] std::span<const FpgaKernelEntry> vision_kernels();
[[nodiscard]] std::span<const FpgaKernelEntry> layer_kernels();
/// The entry for Workload::kernel; null if there is none.
[[nodiscard]] const FpgaKernelEntry* find_kernel(std::string_view kernel);

}  // namespace pirt::fpga
