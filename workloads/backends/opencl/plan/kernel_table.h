// Which workload kernels this backend has; adding one is an entry in its family's table
// (vision_kernels.cpp, dnn_kernels.cpp) and its .cl code.
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "workloads/backends/opencl/plan/plan.h"
#include "workloads/model/backend.h"

namespace pirt::opencl {

/// Appends the launches that compute a workload from @p inputs to @p outputs.
using AppendSteps = void (*)(PlanBuilder& builder, const Workload& workload,
                             std::span<const Tensor> parameters,
                             std::span<const DeviceTensor> inputs,
                             std::span<const DeviceTensor> outputs);
/// For kernels with a part on the host.
using MakeKernel = std::unique_ptr<Kernel> (*)(const DeviceSession& session,
                                               const Workload& workload,
                                               std::span<const Tensor> parameters);

struct OpenclKernelEntry {
  std::string_view kernel;       ///< Workload::kernel.
  AppendSteps append = nullptr;  ///< Either this (such kernels can be layers of a sequence)
  MakeKernel make = nullptr;     ///< or this.
  /// The zero border that the kernel wants around each plane of its first input; null = none.
  int (*input_pad)(const Workload& workload) = nullptr;
};

/// @throws std::logic_error if there is none, of which support_of() warns.
[[nodiscard]] const OpenclKernelEntry& find_kernel(std::string_view kernel);

/// Whether there are kernels that compute the workload as its name says; on @p device too.
[[nodiscard]] Support support_of(const Workload& workload);
[[nodiscard]] Support support_of(const Workload& workload, const cl::Device& device);

/// @throws Error{kEnvironment} or cl::Error if the device cannot.
[[nodiscard]] std::unique_ptr<Kernel> make_kernel(const DeviceSession& session,
                                                  const Workload& workload,
                                                  std::span<const Tensor> parameters);

// The families, each in its own file.
[[nodiscard]] std::span<const OpenclKernelEntry> vision_kernels();
[[nodiscard]] std::span<const OpenclKernelEntry> dnn_kernels();
[[nodiscard]] std::span<const OpenclKernelEntry> own_kernels();

void append_undistort(PlanBuilder& builder, const Workload& workload,
                      std::span<const Tensor> parameters, std::span<const DeviceTensor> inputs,
                      std::span<const DeviceTensor> outputs);
[[nodiscard]] std::unique_ptr<Kernel> make_feature_detect(const DeviceSession& session,
                                                          const Workload& workload,
                                                          std::span<const Tensor> parameters);
[[nodiscard]] std::unique_ptr<Kernel> make_detect_objects(const DeviceSession& session,
                                                          const Workload& workload,
                                                          std::span<const Tensor> parameters);
[[nodiscard]] std::unique_ptr<Kernel> make_extract_features(const DeviceSession& session,
                                                            const Workload& workload,
                                                            std::span<const Tensor> parameters);

}  // namespace pirt::opencl
