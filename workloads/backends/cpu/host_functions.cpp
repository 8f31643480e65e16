// Functions of the library that are kernels as they are: the robot's own work.
#include <array>
#include <memory>

#include "workloads/backends/cpu/kernels.h"
#include "workloads/model/host_function.h"
#include "workloads/model/own_operation.h"

namespace pirt::cpu {
namespace {

std::unique_ptr<Kernel> make_function(const Workload& workload, std::span<const Tensor> parameters,
                                      const std::shared_ptr<BandTeam>&) {
  return std::make_unique<FunctionKernel>(operation_as<HostFunction>(workload).prepare(parameters));
}

std::unique_ptr<Kernel> make_own(const Workload& workload, std::span<const Tensor> parameters,
                                 const std::shared_ptr<BandTeam>& team) {
  return operation_as<OwnOperation>(workload).cpu(parameters, team->size());
}

constexpr std::array kHostFunctions = {
    CpuKernelEntry{kOwnKernel, make_own},
    CpuKernelEntry{"plan_path", make_function},
    CpuKernelEntry{"avoid_obstacles", make_function},
    CpuKernelEntry{"bundle_adjust", make_function},
    CpuKernelEntry{"detect_objects", make_function},
    CpuKernelEntry{"describe_scene", make_function},
};

}  // namespace

std::span<const CpuKernelEntry> host_functions() { return kHostFunctions; }

}  // namespace pirt::cpu
