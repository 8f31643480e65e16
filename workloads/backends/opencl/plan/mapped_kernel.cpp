#include "workloads/backends/opencl/plan/mapped_kernel.h"

#include <fmt/core.h>

#include "workloads/base/contract.h"

namespace pirt::opencl {

MappedKernel::~MappedKernel() {
  try {
    unmap_all();
  } catch (const cl::Error&) {
    // The queue is gone with its device; the host's memory stays the host's.
  }
}

void MappedKernel::bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) {
  expect(inputs.size() == plan_.inputs.size() && outputs.size() == plan_.outputs.size(),
         "other tensors than the plan's");
  translated(fmt::format("mapping the tensors of {}", workload()), [&] {
    unmap_all();
    shared_.clear();
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      share(plan_.inputs[i], inputs[i].data(), inputs[i].bytes().size(), CL_MEM_READ_ONLY,
            CL_MAP_WRITE);
    }
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      share(plan_.outputs[i], outputs[i].data(), outputs[i].bytes().size(), CL_MEM_READ_WRITE,
            CL_MAP_READ | CL_MAP_WRITE);
    }
    map_all();
  });
}

/// A driver that works on memory of its own writes to the host's, or reads it, when it is unmapped.
void MappedKernel::unbind() {
  translated(fmt::format("letting go of the tensors of {}", workload()), [&] {
    unmap_all();
    shared_.clear();
  });
}

void MappedKernel::share(DeviceTensor& resident, const std::byte* data, std::size_t size_bytes,
                         cl_mem_flags access, cl_map_flags flags) {
  // The device only reads inputs; OpenCL has no constant host pointer.
  Shared shared{.buffer = cl::Buffer(session().context, access | CL_MEM_USE_HOST_PTR, size_bytes,
                                     const_cast<std::byte*>(data)),
                .size_bytes = size_bytes,
                .flags = flags};
  plan_.replace(resident, shared.buffer);
  shared_.push_back(std::move(shared));
}

void MappedKernel::upload() {
  translated(fmt::format("handing over the inputs of {}", workload()), [&] { unmap_all(); });
}

void MappedKernel::compute(Launches& launches) {
  unmap_all();  // executing again without another upload is allowed
  enqueue(session(), plan_, launches);
}

void MappedKernel::download() {
  translated(fmt::format("taking back the outputs of {}", workload()), [&] { map_all(); });
}

void MappedKernel::map_all() {
  for (Shared& shared : shared_) {
    if (shared.pointer != nullptr) continue;
    shared.pointer = session().queue.enqueueMapBuffer(shared.buffer, CL_FALSE, shared.flags, 0,
                                                      shared.size_bytes);
  }
  session().queue.finish();
}

void MappedKernel::unmap_all() {
  bool any = false;
  for (Shared& shared : shared_) {
    if (shared.pointer == nullptr) continue;
    session().queue.enqueueUnmapMemObject(shared.buffer, shared.pointer);
    shared.pointer = nullptr;
    any = true;
  }
  if (any) session().queue.finish();
}

}  // namespace pirt::opencl
