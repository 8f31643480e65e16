#include "workloads/opencl/kernel_table.h"

#include <algorithm>
#include <array>
#include <cassert>

#include "workloads/opencl/mapped_kernel.h"
#include "workloads/opencl/plan_kernel.h"

namespace pirt::opencl {
namespace {

constexpr std::array kTable = {
    KernelEntry{.kernel = "gaussian_blur", .append = append_gaussian_blur},
    KernelEntry{.kernel = "filter7x7", .append = append_filter7x7},
    KernelEntry{.kernel = "sobel", .append = append_sobel},
    KernelEntry{.kernel = "undistort", .append = append_undistort},
    KernelEntry{.kernel = "feature_detect", .make = make_feature_detect},
    KernelEntry{.kernel = "optical_flow", .append = append_optical_flow},
    KernelEntry{
        .kernel = "conv2d_relu", .append = append_conv2d_relu, .input_pad = conv2d_relu_pad},
    KernelEntry{.kernel = "max_pool", .append = append_max_pool},
    KernelEntry{.kernel = "fully_connected", .append = append_fully_connected},
    KernelEntry{.kernel = "sequence", .append = append_sequence, .input_pad = sequence_pad},
};

}  // namespace

std::span<const KernelEntry> kernel_table() { return kTable; }

const KernelEntry* find_kernel(std::string_view kernel) {
  const auto* it = std::ranges::find(kTable, kernel, &KernelEntry::kernel);
  return it == kTable.end() ? nullptr : it;
}

std::unique_ptr<Kernel> make_kernel(const Session& session, const Workload& workload,
                                    std::span<const Tensor> parameters) {
  const KernelEntry* entry = find_kernel(workload.kernel);
  assert(entry != nullptr && "prepare() of a workload that supports() refuses");
  if (entry->make != nullptr) return entry->make(session, workload, parameters);

  PlanBuilder builder(session);
  std::vector<Resident> inputs;
  for (const TensorSpec& spec : workload.inputs) {
    const bool bordered = inputs.empty() && entry->input_pad != nullptr;
    inputs.push_back(builder.resident(spec, bordered ? entry->input_pad(workload) : 0));
  }
  std::vector<Resident> outputs;
  for (const TensorSpec& spec : workload.outputs) outputs.push_back(builder.resident(spec));
  entry->append(builder, workload, parameters, inputs, outputs);
  Plan plan = builder.finish(std::move(inputs), std::move(outputs));
  if (workload.variant == "map") {
    return std::make_unique<MappedKernel>(session, workload.name, std::move(plan));
  }
  return std::make_unique<PlanKernel>(session, workload.name, std::move(plan));
}

}  // namespace pirt::opencl
