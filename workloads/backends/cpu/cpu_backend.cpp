#include "workloads/backends/cpu/cpu_backend.h"

#include <fmt/core.h>

#include <algorithm>
#include <fstream>
#include <opencv2/core.hpp>
#include <string>
#include <utility>

#include "workloads/backends/cpu/bands.h"
#include "workloads/backends/cpu/dnn_precision.h"
#include "workloads/backends/cpu/kernels.h"
#include "workloads/backends/cpu/onednn.h"
#include "workloads/backends/cpu/peak_loops.h"
#include "workloads/backends/cpu/threads.h"
#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/system/caches.h"
#include "workloads/model/device_choice.h"
#include "workloads/model/own_operation.h"

namespace pirt {
namespace {

std::string cpu_model() {
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);) {
    // "model name" on x86, "Hardware" or "Model" on many ARM boards.
    for (const std::string_view key : {"model name", "Hardware", "Model"}) {
      const auto colon = line.find(": ");
      if (line.starts_with(key) && colon != std::string::npos) return line.substr(colon + 2);
    }
  }
  return "CPU";
}

DeviceInfo device_info(int cores) {
  const auto* onednn = dnnl_version();
  return {cpu_model(),
          "OpenCV + oneDNN",
          fmt::format("OpenCV {}, oneDNN {}.{}.{}", cv::getVersionString(), onednn->major,
                      onednn->minor, onednn->patch),
          cores,
          true,
          read_cache_sizes().last_bytes};
}

const cpu::CpuKernelEntry* find_kernel(std::string_view name) {
  for (const auto table :
       {cpu::vision_kernels(), cpu::dnn_kernels(), cpu::slam_kernels(), cpu::host_functions()}) {
    const auto it = std::ranges::find(table, name, &cpu::CpuKernelEntry::kernel);
    if (it != table.end()) return &*it;
  }
  return nullptr;
}

Support support_of(const Workload& workload) {
  if (workload.variant == "map") {
    return {false, "backend cpu computes on the host's tensors where they are: nothing to map"};
  }
  if (const OwnOperation* const own = own_operation(workload)) return own->support_by("cpu");
  if (find_kernel(workload.kernel) != nullptr) {
    const std::string missing = cpu::missing_precision(workload);
    return {missing.empty(), missing};
  }
  return {false, "backend cpu has no kernel '" + workload.kernel + "'"};
}

[[noreturn]] void fail(std::string_view doing, std::string_view what, std::string_view library,
                       const char* reason) {
  throw_environment(
      fmt::format("cannot {} '{}' on backend cpu: {} says: {}", doing, what, library, reason));
}

/// Runs @p call with the libraries' exceptions turned into ours.
template <typename Call>
auto translated(std::string_view doing, std::string_view what, const Call& call) {
  try {
    return call();
  } catch (const cv::Exception& error) {
    fail(doing, what, "OpenCV", error.err.c_str());
  } catch (const dnnl::error& error) {
    fail(doing, what, "oneDNN", error.what());
  }
}

/// Gives each call the size of its OpenMP team and translates errors.
class GuardedKernel : public Kernel, public OtherProcess {
 public:
  GuardedKernel(std::string name, std::unique_ptr<Kernel> kernel, int threads)
      : name_(std::move(name)), kernel_(std::move(kernel)), threads_(threads) {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    kernel_->bind(inputs, outputs);
  }

  void bind_state(std::span<const Tensor> current, std::span<Tensor> next) override {
    kernel_->bind_state(current, next);
  }

  void scribble(std::byte with) override { kernel_->scribble(with); }

  std::vector<std::string> remarks() const override { return kernel_->remarks(); }

  std::optional<std::int64_t> peak_bytes() const override {
    const auto* const other = dynamic_cast<const OtherProcess*>(kernel_.get());
    return other != nullptr ? other->peak_bytes() : std::nullopt;
  }
  std::optional<Nanos> processor_time() const override {
    const auto* const other = dynamic_cast<const OtherProcess*>(kernel_.get());
    return other != nullptr ? other->processor_time() : std::nullopt;
  }

  std::optional<Nanos> execute(int repeats) override {
    cpu::set_openmp_threads(threads_);
    return translated("run", name_, [&] { return kernel_->execute(repeats); });
  }

 private:
  std::string name_;
  std::unique_ptr<Kernel> kernel_;
  int threads_;
};

class CpuDevice : public Device {
 public:
  explicit CpuDevice(int threads)
      : threads_(threads), team_(std::make_shared<cpu::BandTeam>(threads)) {}

  DeviceInfo info() const override { return device_info(threads_); }

  Support supports(const Workload& workload) const override { return support_of(workload); }

  PeakLoops peak_loops() override {
    return translated("prepare", "peak loops", [&] { return cpu::make_peak_loops(threads_); });
  }

 private:
  std::unique_ptr<Kernel> make_kernel(const Workload& workload,
                                      std::span<const Tensor> parameters) override {
    const auto make = find_kernel(workload.kernel)->make;
    cpu::set_openmp_threads(threads_);
    auto kernel =
        translated("prepare", workload.name, [&] { return make(workload, parameters, team_); });
    return std::make_unique<GuardedKernel>(workload.name, std::move(kernel), threads_);
  }

  int threads_;
  std::shared_ptr<cpu::BandTeam> team_;
};

class CpuBackend : public Backend {
 public:
  std::string_view name() const override { return "cpu"; }
  std::string_view description() const override {
    return "the host's cores: OpenCV for vision, oneDNN for AlexNet";
  }
  std::vector<Phase> phases() const override {
    return {Phase::kDeviceInit, Phase::kPrepare, Phase::kExecute, Phase::kCall};
  }
  Probe probe() const override { return {true, "", {device_info(bind_to_cores({}, "cpu"))}}; }
  Support supports(const Workload& workload) const override { return support_of(workload); }

  std::unique_ptr<Device> open(const UnitRequest& request) const override {
    const auto info = device_info(0);
    if (!is_named(info, request.device)) {
      throw_environment(
          fmt::format("unit '{}' asks for the device '{}', but backend cpu has only "
                      "'{}' ({}); leave `device:` out",
                      request.unit, request.device, info.name, info.platform));
    }
    const int threads = bind_to_cores(request.cores, request.unit);
    auto device = std::make_unique<CpuDevice>(threads);
    // libgomp ends the process where it gets no thread: whether as many can be had is asked before.
    { const cpu::BandTeam as_many(threads); }
    translated("open", request.unit, [&] { cpu::start_openmp_team(threads); });
    return device;
  }
};

}  // namespace

std::unique_ptr<const Backend> make_cpu_backend() { return std::make_unique<CpuBackend>(); }

}  // namespace pirt
