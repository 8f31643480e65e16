#include "workloads/opencl/plan_kernel.h"

#include <fmt/core.h>

#include <cassert>

namespace pirt::opencl {

void PlanKernel::bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) {
  assert(inputs.size() == plan_.inputs.size());
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    assert(inputs[i].spec().size_bytes() == plan_.inputs[i].spec.size_bytes());
  }
  inputs_ = inputs;
  outputs_ = outputs;
}

void PlanKernel::upload() {
  translated(fmt::format("uploading the inputs of {}", workload_), [&] {
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      write(session_, plan_.inputs[i], inputs_[i].data());
    }
  });
}

std::optional<Nanos> PlanKernel::execute(int repeats) {
  return translated(fmt::format("executing {}", workload_), [&] {
    LaunchTimes times;
    for (int i = 0; i < repeats; ++i) enqueue(session_, plan_, times);
    return times.finish();
  });
}

void PlanKernel::download() {
  translated(fmt::format("downloading the outputs of {}", workload_), [&] {
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      read(session_, plan_.outputs[i], outputs_[i].data());
    }
  });
}

}  // namespace pirt::opencl
