#include "workloads/backends/opencl/plan/kernel_table.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "workloads/backends/opencl/plan/mapped_kernel.h"
#include "workloads/backends/opencl/plan/plan_kernel.h"
#include "workloads/base/text/text.h"
#include "workloads/dnn/dnn.h"
#include "workloads/model/own_operation.h"

namespace pirt::opencl {
namespace {

constexpr std::array kFamilies = {vision_kernels, dnn_kernels, own_kernels};

const OpenclKernelEntry* try_find_kernel(std::string_view kernel) {
  for (const auto family : kFamilies) {
    const auto entries = family();
    const auto it = std::ranges::find(entries, kernel, &OpenclKernelEntry::kernel);
    if (it != entries.end()) return &*it;
  }
  return nullptr;
}

/// The host's tensors have no borders, and a part on the host has no buffer.
Support supports_mapping(const Workload& workload, const OpenclKernelEntry& entry) {
  if (entry.append == nullptr) {
    return {.ok = false, .reason = "a part of it runs on the host: nothing to map"};
  }
  if (entry.input_pad != nullptr && entry.input_pad(workload) > 0) {
    return {.ok = false,
            .reason = "its kernel wants a border around the input, which is made by copying"};
  }
  return {.ok = true, .reason = {}};
}

}  // namespace

const OpenclKernelEntry& find_kernel(std::string_view kernel) {
  if (const OpenclKernelEntry* entry = try_find_kernel(kernel)) return *entry;
  throw std::logic_error("opencl has no kernel \"" + std::string(kernel) + "\"");
}

Support support_of(const Workload& workload) {
  const OpenclKernelEntry* entry = try_find_kernel(workload.kernel);
  if (entry == nullptr) {
    if (workload.operation && !workload.operation->host_only().empty()) {
      return {.ok = false, .reason = std::string(workload.operation->host_only())};
    }
    std::vector<std::string> known;
    for (const auto family : kFamilies) {
      for (const OpenclKernelEntry& each : family()) known.emplace_back(each.kernel);
    }
    return {.ok = false,
            .reason = fmt::format("opencl has no kernel \"{}\"; it has {}", workload.kernel,
                                  join(known, ", "))};
  }
  if (const OwnOperation* const own = own_operation(workload)) {
    if (workload.variant == "map" && own->opencl_function) {
      return {.ok = false,
              .reason = "its functions keep the buffers that they were given: nothing to map"};
    }
    return own->support_by("opencl");
  }
  if (const auto* chain = dynamic_cast<const dnn::Sequence*>(workload.operation.get())) {
    for (const Workload& layer : chain->layers) {
      const OpenclKernelEntry* part = try_find_kernel(layer.kernel);
      if (part == nullptr || part->append == nullptr) {
        return {.ok = false,
                .reason = fmt::format("opencl cannot run kernel \"{}\" (layer {}) in a sequence",
                                      layer.kernel, layer.name)};
      }
    }
  }
  if (workload.precision != Precision::kF32) {
    return {.ok = false,
            .reason = fmt::format("opencl computes AlexNet's layers in f32; backend cpu has {}",
                                  to_string(workload.precision))};
  }
  if (workload.variant == "map") return supports_mapping(workload, *entry);
  return {.ok = true, .reason = {}};
}

Support support_of(const Workload& workload, const cl::Device& device) {
  Support support = support_of(workload);
  if (support.ok && workload.variant == "map" && !shares_memory(device)) {
    support = {.ok = false, .reason = "the device has memory of its own: nothing to map"};
  }
  return support;
}

std::unique_ptr<Kernel> make_kernel(const DeviceSession& session, const Workload& workload,
                                    std::span<const Tensor> parameters) {
  const OpenclKernelEntry& entry = find_kernel(workload.kernel);
  if (entry.make != nullptr) return entry.make(session, workload, parameters);

  const OwnOperation* const own = own_operation(workload);
  const bool in_parts = own == nullptr || !own->opencl_function;
  PlanBuilder builder(session, workload.kernel != kOwnKernel);
  std::vector<DeviceTensor> inputs;
  if (const int pad = entry.input_pad != nullptr ? entry.input_pad(workload) : 0; pad > 0) {
    for (const TensorSpec& spec : workload.inputs) {
      inputs.push_back(builder.resident(spec, inputs.empty() ? pad : 0));
    }
  } else {
    inputs = builder.residents(workload.inputs, in_parts);
  }
  std::vector<DeviceTensor> outputs = builder.residents(workload.outputs, in_parts);
  if (workload.state) builder.make_state(workload.state->tensors);
  entry.append(builder, workload, parameters, inputs, outputs);
  Plan plan = builder.finish(std::move(inputs), std::move(outputs));
  if (workload.variant == "map") {
    return std::make_unique<MappedKernel>(session, workload.name, std::move(plan));
  }
  return std::make_unique<PlanKernel>(session, workload.name, std::move(plan));
}

}  // namespace pirt::opencl
