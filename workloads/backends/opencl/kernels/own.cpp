// Workloads of somebody else's: their source, or what their functions enqueue.
#include <array>
#include <optional>

#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/model/own_operation.h"

namespace pirt::opencl {
namespace {

/// Those of a call, as OpenCL's handles.
std::vector<void*> handles(std::span<const DeviceTensor> tensors) {
  std::vector<void*> all;
  for (const DeviceTensor& tensor : tensors) all.push_back(tensor.buffer());
  return all;
}

void append_own(PlanBuilder& builder, const Workload& workload, std::span<const Tensor> parameters,
                std::span<const DeviceTensor> inputs, std::span<const DeviceTensor> outputs) {
  const auto& own = operation_as<OwnOperation>(workload);
  std::vector<DeviceTensor> constants;
  for (const Tensor& parameter : parameters) {
    constants.push_back({.buffer = builder.constant(parameter.bytes()), .spec = parameter.spec()});
  }
  if (own.opencl_function) {
    const DeviceSession& session = builder.session();
    builder.own_step(own.opencl_function({.context = session.context(),
                                          .device = session.device(),
                                          .queue = session.queue(),
                                          .inputs = handles(inputs),
                                          .outputs = handles(outputs),
                                          .parameters = handles(constants)}));
    return;
  }
  builder.own_step(own.opencl.value(), [&](const std::string& name) -> const DeviceTensor* {
    for (const auto tensors : {inputs, outputs, std::span<const DeviceTensor>(constants)}) {
      for (const DeviceTensor& tensor : tensors) {
        if (tensor.spec.name == name) return &tensor;
      }
    }
    const std::size_t states = workload.state ? workload.state->tensors.size() : 0;
    for (std::size_t i = 0; i < states; ++i) {
      const std::string& state = workload.state->tensors[i].name;
      if (name == state) return &builder.current(i);
      if (name == "next " + state) return &builder.next(i);
    }
    return nullptr;
  });
}

constexpr std::array kOwnKernels = {OpenclKernelEntry{.kernel = kOwnKernel, .append = append_own}};

}  // namespace

std::span<const OpenclKernelEntry> own_kernels() { return kOwnKernels; }

}  // namespace pirt::opencl
