#include "workloads/backends/opencl/plan/plan_kernel.h"

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
      write(session_, plan_.inputs[i], inputs_[i]);
    }
  });
}

std::optional<Nanos> PlanKernel::execute(int repeats) {
  return translated(fmt::format("executing {}", workload_), [&] {
    LaunchTimes times(session_.has_clock);
    for (int i = 0; i < repeats; ++i) enqueue(session_, plan_, times);
    return times.finish();
  });
}

void PlanKernel::download() {
  translated(fmt::format("downloading the outputs of {}", workload_), [&] {
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      read(session_, plan_.outputs[i], outputs_[i]);
    }
    for (std::size_t i = 0; i < next_.size(); ++i) read(session_, plan_.next[i], next_[i]);
  });
}

void PlanKernel::bind_state(std::span<const Tensor> current, std::span<Tensor> next) {
  if (plan_.current.empty()) {
    Kernel::bind_state(current, next);
    return;
  }
  assert(current.size() == plan_.current.size() && next.size() == plan_.next.size());
  current_ = current;
  next_ = next;
}

void PlanKernel::upload_state() {
  translated(fmt::format("uploading the state of {}", workload_), [&] {
    for (std::size_t i = 0; i < current_.size(); ++i) {
      write(session_, plan_.current[i], current_[i]);
    }
  });
}

void PlanKernel::commit_state() {
  translated(fmt::format("committing the state of {}", workload_), [&] { plan_.swap_state(); });
}

}  // namespace pirt::opencl
