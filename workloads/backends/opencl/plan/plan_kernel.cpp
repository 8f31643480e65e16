#include "workloads/backends/opencl/plan/plan_kernel.h"

#include <fmt/core.h>

#include "workloads/base/contract.h"

namespace pirt::opencl {

std::optional<Nanos> LaunchingKernel::execute(int repeats) {
  translated(fmt::format("executing {}", workload_), [&] {
    Launches launches(session_.queue, false);
    for (int i = 0; i < repeats; ++i) compute(launches);
    launches.finish();
  });
  return std::nullopt;
}

std::optional<Nanos> LaunchingKernel::stamped_launch() {
  const auto stamps = stamped();
  return stamps ? std::optional(stamps->total()) : std::nullopt;
}

std::optional<LaunchSum> LaunchingKernel::stamped() {
  if (!session_.has_clock) return std::nullopt;
  return translated(fmt::format("executing {}", workload_), [&] {
    Launches launches(session_.queue, true);
    compute(launches);
    launches.finish();
    return launches.stamps();
  });
}

void PlanKernel::bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) {
  expect(inputs.size() == plan_.inputs.size(), "other inputs than the plan's");
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    expect(inputs[i].spec().size_bytes() == plan_.inputs[i].spec.size_bytes(),
           "an input of another size than the plan's");
  }
  inputs_ = inputs;
  outputs_ = outputs;
}

void PlanKernel::upload() {
  translated(fmt::format("uploading the inputs of {}", workload()),
             [&] { transfers_.write(plan_.inputs, inputs_); });
}

void PlanKernel::compute(Launches& launches) { enqueue(session(), plan_, launches); }

void PlanKernel::download() {
  translated(fmt::format("downloading the outputs of {}", workload()), [&] {
    transfers_.read({{plan_.outputs, outputs_}, {plan_.next, next_}});
  });
}

void PlanKernel::scribble(std::byte with) {
  translated(fmt::format("filling the outputs of {}", workload()), [&] {
    for (const DeviceTensor& output : plan_.outputs) {
      session().queue.enqueueFillBuffer(output.buffer, std::to_integer<cl_uchar>(with), 0,
                                        static_cast<std::size_t>(output.spec.size_bytes()));
    }
    session().queue.finish();
  });
}

void PlanKernel::bind_state(std::span<const Tensor> current, std::span<Tensor> next) {
  if (plan_.current.empty()) {
    Kernel::bind_state(current, next);
    return;
  }
  expect(current.size() == plan_.current.size() && next.size() == plan_.next.size(),
         "another state than the plan's");
  current_ = current;
  next_ = next;
}

void PlanKernel::upload_state() {
  translated(fmt::format("uploading the state of {}", workload()),
             [&] { transfers_.write(plan_.current, current_); });
}

void PlanKernel::commit_state() {
  translated(fmt::format("committing the state of {}", workload()), [&] { plan_.swap_state(); });
}

}  // namespace pirt::opencl
