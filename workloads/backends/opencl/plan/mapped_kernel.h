// Variant @map: inputs and outputs are the host's own tensors, which change hands by mapping.
//
// Where host and device share memory nothing is copied: upload hands what the host holds to the
// device (unmap), download takes it back (map). What the host has between a download and the next
// upload is both, to write inputs and to read outputs.
#pragma once

#include <string>
#include <vector>

#include "workloads/backends/opencl/plan/plan_kernel.h"

namespace pirt::opencl {

class MappedKernel final : public LaunchingKernel {
 public:
  /// @param plan  Its inputs and outputs have no border.
  MappedKernel(DeviceSession session, std::string workload, Plan plan)
      : LaunchingKernel(std::move(session), std::move(workload), plan.size_bytes),
        plan_(std::move(plan)) {}
  /// Takes back what the device holds: the tensors are the caller's again.
  ~MappedKernel() override;

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override;
  void unbind() override;
  void upload() override;
  void download() override;

 private:
  struct Shared {
    cl::Buffer buffer;
    std::size_t size_bytes = 0;
    cl_map_flags flags = 0;
    void* pointer = nullptr;  ///< Where it is mapped; null = the device has it.
  };
  void share(DeviceTensor& resident, const std::byte* data, std::size_t size_bytes,
             cl_mem_flags access, cl_map_flags flags);
  void map_all();
  void unmap_all();
  void compute(Launches& launches) override;

  Plan plan_;
  std::vector<Shared> shared_;
};

}  // namespace pirt::opencl
