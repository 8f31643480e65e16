// Which workload kernels this backend has; adding one is an entry in kernel_table.cpp and its .cl
// code.
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "workloads/backend.h"
#include "workloads/opencl/plan.h"

namespace pirt::opencl {

/// Appends the launches that compute a workload from @p inputs to @p outputs.
using AppendSteps = void (*)(PlanBuilder& builder, const Workload& workload,
                             std::span<const Tensor> parameters, std::span<const Resident> inputs,
                             std::span<const Resident> outputs);
/// For kernels with a part on the host.
using MakeKernel = std::unique_ptr<Kernel> (*)(const Session& session, const Workload& workload,
                                               std::span<const Tensor> parameters);

struct KernelEntry {
  std::string_view kernel;       ///< Workload::kernel.
  AppendSteps append = nullptr;  ///< Either this (such kernels can be layers of a sequence)
  MakeKernel make = nullptr;     ///< or this.
  /// The zero border that the kernel wants around each plane of its first input; null = none.
  int (*input_pad)(const Workload& workload) = nullptr;
};

/// @throws std::logic_error if there is none, of which support_of() warns.
[[nodiscard]] const KernelEntry& find_kernel(std::string_view kernel);

/// Whether there are kernels that compute the workload as its name says; on @p device too.
[[nodiscard]] Support support_of(const Workload& workload);
[[nodiscard]] Support support_of(const Workload& workload, const cl::Device& device);

/// @throws Error{kEnvironment} or cl::Error if the device cannot.
[[nodiscard]] std::unique_ptr<Kernel> make_kernel(const Session& session, const Workload& workload,
                                                  std::span<const Tensor> parameters);

// The entries' functions, by family.
void append_gaussian_blur(PlanBuilder&, const Workload&, std::span<const Tensor>,
                          std::span<const Resident>, std::span<const Resident>);
void append_filter7x7(PlanBuilder&, const Workload&, std::span<const Tensor>,
                      std::span<const Resident>, std::span<const Resident>);
void append_sobel(PlanBuilder&, const Workload&, std::span<const Tensor>, std::span<const Resident>,
                  std::span<const Resident>);
void append_undistort(PlanBuilder&, const Workload&, std::span<const Tensor>,
                      std::span<const Resident>, std::span<const Resident>);
void append_optical_flow(PlanBuilder&, const Workload&, std::span<const Tensor>,
                         std::span<const Resident>, std::span<const Resident>);
std::unique_ptr<Kernel> make_feature_detect(const Session&, const Workload&,
                                            std::span<const Tensor>);
void append_conv2d_relu(PlanBuilder&, const Workload&, std::span<const Tensor>,
                        std::span<const Resident>, std::span<const Resident>);
int conv2d_relu_pad(const Workload&);
void append_max_pool(PlanBuilder&, const Workload&, std::span<const Tensor>,
                     std::span<const Resident>, std::span<const Resident>);
void append_fully_connected(PlanBuilder&, const Workload&, std::span<const Tensor>,
                            std::span<const Resident>, std::span<const Resident>);
void append_sequence(PlanBuilder&, const Workload&, std::span<const Tensor>,
                     std::span<const Resident>, std::span<const Resident>);
int sequence_pad(const Workload&);

}  // namespace pirt::opencl
