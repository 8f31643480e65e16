// Functions of the library that are kernels as they are: the robot's own work.
#include <array>
#include <memory>

#include "workloads/backends/cpu/kernels.h"
#include "workloads/model/host_function.h"

namespace pirt::cpu {
namespace {

std::unique_ptr<Kernel> make_function(const Workload& workload, std::span<const Tensor> parameters,
                                      const std::shared_ptr<BandTeam>&) {
  return std::make_unique<FunctionKernel>(operation_as<HostFunction>(workload).prepare(parameters));
}

constexpr std::array kKernels = {
    KernelEntry{"plan_path", make_function},      KernelEntry{"avoid_obstacles", make_function},
    KernelEntry{"bundle_adjust", make_function},  KernelEntry{"detect_objects", make_function},
    KernelEntry{"describe_scene", make_function},
};

}  // namespace

std::span<const KernelEntry> host_functions() { return kKernels; }

}  // namespace pirt::cpu
