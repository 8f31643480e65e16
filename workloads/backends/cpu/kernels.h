// The kernel table of the cpu backend: kernel name -> factory. A new kernel is one entry in
// vision_kernels.cpp or dnn_kernels.cpp.
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "workloads/backends/cpu/bands.h"
#include "workloads/model/backend.h"

namespace pirt::cpu {

/// @param team  The unit's threads, for what does not have its own (oneDNN has).
using KernelFactory = std::unique_ptr<Kernel> (*)(const Workload& workload,
                                                  std::span<const Tensor> parameters,
                                                  const std::shared_ptr<BandTeam>& team);

struct CpuKernelEntry {
  std::string_view kernel;  ///< Workload::kernel.
  KernelFactory make;
};

// Those with a file of their own.
[[nodiscard]] std::unique_ptr<Kernel> make_track_features(const Workload& workload,
                                                          std::span<const Tensor> parameters,
                                                          const std::shared_ptr<BandTeam>& team);
[[nodiscard]] std::unique_ptr<Kernel> make_background_model(const Workload& workload,
                                                            std::span<const Tensor> parameters,
                                                            const std::shared_ptr<BandTeam>& team);

[[nodiscard]] std::unique_ptr<Kernel> make_extract_features(const Workload& workload,
                                                            std::span<const Tensor> parameters,
                                                            const std::shared_ptr<BandTeam>& team);

/// Of a fully connected layer in int8, on one image.
[[nodiscard]] std::unique_ptr<Kernel> make_int8_product(const Workload& workload,
                                                        std::span<const Tensor> parameters,
                                                        const std::shared_ptr<BandTeam>& team);

[[nodiscard]] std::span<const CpuKernelEntry> vision_kernels();
[[nodiscard]] std::span<const CpuKernelEntry> dnn_kernels();
[[nodiscard]] std::span<const CpuKernelEntry> slam_kernels();
/// Of workloads that are functions of the library (workloads/model/host_function.h).
[[nodiscard]] std::span<const CpuKernelEntry> host_functions();

}  // namespace pirt::cpu
