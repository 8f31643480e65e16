#include "workloads/backends/opencl/opencl_backend.h"

#include "workloads/backends/opencl/device/kernel_cache.h"
#include "workloads/backends/opencl/opencl_device.h"
#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/backends/opencl/tuning/tuning_file.h"

namespace pirt {
namespace {

class OpenClBackend final : public Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "opencl"; }
  [[nodiscard]] std::string_view description() const override {
    return "OpenCL 1.2 kernels on any installed driver (ICD), PoCL for instance";
  }

  [[nodiscard]] std::vector<Phase> phases() const override {
    return {Phase::kDeviceInit, Phase::kPrepare,  Phase::kUpload, Phase::kLaunch,
            Phase::kExecute,    Phase::kDownload, Phase::kCall};
  }

  [[nodiscard]] Probe probe() const override {
    Probe probe;
    try {
      for (const cl::Device& device : opencl::all_devices()) {
        probe.devices.push_back(opencl::describe(device));
      }
      if (probe.devices.empty()) {
        probe.reason = opencl::why_no_device();
      }
    } catch (const cl::Error& error) {
      probe.devices.clear();
      probe.reason = opencl::describe(error);
    }
    probe.available = probe.reason.empty();
    return probe;
  }

  [[nodiscard]] Support supports(const Workload& workload) const override {
    return opencl::support_of(workload);
  }

  /// The file of tuned parameters is read here too: a damaged one is the user's to mend before
  /// anything is measured.
  [[nodiscard]] Support supports_on(const UnitRequest& request,
                                    const Workload& workload) const override {
    static_cast<void>(opencl::load_tuning());
    if (workload.variant != "map") return supports(workload);
    try {
      return opencl::support_of(workload, opencl::find_device(request.device).device);
    } catch (const std::exception& error) {
      return {.ok = false, .reason = error.what()};
    }
  }

  [[nodiscard]] std::unique_ptr<Device> open(const UnitRequest& request) const override {
    return opencl::open_device(request);
  }

  /// PoCL, NVIDIA, Intel (two generations), Mesa, AMD; XDG_CACHE_HOME for those that keep to it.
  [[nodiscard]] std::vector<std::pair<std::string, std::string>> kernel_cache_environment(
      const std::string& folder) const override {
    std::vector<std::pair<std::string, std::string>> variables;
    for (const char* variable :
         {"POCL_CACHE_DIR", "CUDA_CACHE_PATH", "NEO_CACHE_DIR", "cl_cache_dir",
          "MESA_SHADER_CACHE_DIR", "AMD_COMGR_CACHE_DIR", "XDG_CACHE_HOME"}) {
      variables.emplace_back(variable, folder);
    }
    return variables;
  }
};

}  // namespace

std::unique_ptr<const Backend> make_opencl_backend() { return std::make_unique<OpenClBackend>(); }

}  // namespace pirt
