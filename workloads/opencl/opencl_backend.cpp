#include "workloads/opencl/opencl_backend.h"

#include <fmt/format.h>

#include "workloads/base/text.h"
#include "workloads/dnn/dnn.h"
#include "workloads/opencl/kernel_table.h"
#include "workloads/opencl/mapped_kernel.h"
#include "workloads/opencl/opencl_device.h"
#include "workloads/opencl/tuning_file.h"

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
        probe.reason = fmt::format("no OpenCL device; {}", opencl::kInstallDriver);
      }
    } catch (const cl::Error& error) {
      probe.devices.clear();
      probe.reason = opencl::describe(error);
    }
    probe.available = probe.reason.empty();
    return probe;
  }

  [[nodiscard]] Support supports(const Workload& workload) const override {
    const opencl::KernelEntry* entry = opencl::find_kernel(workload.kernel);
    if (entry == nullptr) {
      std::vector<std::string> known;
      for (const auto& e : opencl::kernel_table()) known.emplace_back(e.kernel);
      return {.ok = false,
              .reason = fmt::format("opencl has no kernel \"{}\"; it has {}", workload.kernel,
                                    join(known, ", "))};
    }
    if (const auto* chain = dynamic_cast<const dnn::Sequence*>(workload.operation.get())) {
      for (const Workload& layer : chain->layers) {
        const opencl::KernelEntry* part = opencl::find_kernel(layer.kernel);
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

  /// The file of tuned parameters is read here too: a damaged one is the user's to mend before
  /// anything is measured.
  [[nodiscard]] Support supports_on(const UnitRequest& request,
                                    const Workload& workload) const override {
    static_cast<void>(opencl::load_tuning());
    Support support = supports(workload);
    if (!support.ok || workload.variant != "map") return support;
    try {
      const cl::Device device = opencl::choose_device(opencl::all_devices(), request.device);
      if (!opencl::shares_memory(device)) {
        support = {.ok = false, .reason = "the device has memory of its own: nothing to map"};
      }
    } catch (const std::exception& error) {
      support = {.ok = false, .reason = error.what()};
    }
    return support;
  }

  [[nodiscard]] std::unique_ptr<Device> open(const UnitRequest& request) const override {
    return opencl::open_device(request);
  }

  /// The host's tensors have no borders, and a part on the host has no buffer.
  static Support supports_mapping(const Workload& workload, const opencl::KernelEntry& entry) {
    if (entry.append == nullptr) {
      return {.ok = false, .reason = "a part of it runs on the host: nothing to map"};
    }
    if (entry.input_pad != nullptr && entry.input_pad(workload) > 0) {
      return {.ok = false,
              .reason = "its kernel wants a border around the input, which is made by copying"};
    }
    return {.ok = true, .reason = {}};
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
