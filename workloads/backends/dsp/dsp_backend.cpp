#include "workloads/backends/dsp/dsp_backend.h"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "workloads/backends/dsp/cost_model.h"
#include "workloads/backends/dsp/dsp_options.h"
#include "workloads/backends/dsp/kernels.h"
#include "workloads/backends/dsp/tools.h"
#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"
#include "workloads/model/counted_clock.h"

namespace pirt {
namespace {

Support dsp_support(const Workload& workload) {
  if (workload.variant == "map") {
    return {false, "backend dsp shares its memory with the host as it is: nothing to map"};
  }
  const auto* const entry = dsp::find_kernel(workload.kernel);
  if (entry == nullptr) {
    const auto* const operation = workload.operation.get();
    const bool is_host_only = operation != nullptr && !operation->host_only().empty();
    return {false, is_host_only ? std::string(operation->host_only())
                                : "backend dsp has no kernel '" + workload.kernel + "'"};
  }
  const std::string fault = entry->fault(workload);
  return {fault.empty(), fault};
}

class DspKernel : public Kernel {
 public:
  DspKernel(std::shared_ptr<dsp::ProgramSession> session, dsp::Call call,
            const dsp::CostModel& model, CountedClock& clock)
      : session_(std::move(session)), call_(std::move(call)), model_(model), clock_(clock) {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    inputs_ = inputs;
    outputs_ = outputs;
  }

  void upload() override {
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      dsp::copy_in(*session_, call_.inputs[i], inputs_[i].bytes());
      clock_.advance(model_.copy(inputs_[i].bytes().size()));
    }
  }

  std::optional<Nanos> execute(int repeats) override {
    for (int i = 0; i < repeats; ++i) {
      cost_ = dsp::run(*session_, call_);
      clock_.advance(model_.launch() + model_.with_memory(cost_));
    }
    return repeats * model_.launch();
  }

  void download() override {
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      if (call_.rows && outputs_[i].spec().varies) {
        std::int32_t rows = 0;
        dsp::copy_out(*session_, *call_.rows, std::as_writable_bytes(std::span(&rows, 1)));
        outputs_[i].set_rows(rows);
      }
      dsp::copy_out(*session_, call_.outputs[i], {outputs_[i].data(), outputs_[i].bytes().size()});
      clock_.advance(model_.copy(outputs_[i].bytes().size()));
    }
  }

  /// What has been counted of the last call, without the model of the memory.
  [[nodiscard]] std::optional<Nanos> bound(Phase phase) const override {
    if (phase != Phase::kExecute) return std::nullopt;
    return model_.without_stalls(cost_);
  }

 private:
  std::shared_ptr<dsp::ProgramSession> session_;
  dsp::Call call_;
  dsp::CostModel model_;
  CountedClock& clock_;
  dsp::Cost cost_;
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
};

class DspDevice : public Device {
 public:
  DspDevice(const dsp::Tools& tools, const dsp::CostModel& model)
      : version_(
            fmt::format("{}, program {}", dsp::emulator_version(tools), dsp::program_hash(tools))),
        session_(
            std::make_shared<dsp::ProgramSession>(dsp::SessionOptions{.emulator = tools.emulator,
                                                                      .plugin = tools.plugin,
                                                                      .program = tools.program,
                                                                      .models_memory = true})),
        program_bytes_(std::filesystem::file_size(tools.program)),
        model_(model) {
    clock_.advance(model_.without_stalls(session_->start_cost()));
  }

  [[nodiscard]] DeviceInfo info() const override {
    return {.name = "Hexagon v60, one HVX thread",
            .platform = "qemu-hexagon, packets counted",
            .version = version_,
            .compute_units = 1};
  }
  [[nodiscard]] Support supports(const Workload& workload) const override {
    return dsp_support(workload);
  }
  [[nodiscard]] const Clock* own_clock() const override { return &clock_; }
  [[nodiscard]] Provenance provenance() const override { return Provenance::kCounted; }
  [[nodiscard]] Accounting accounting(Phase phase) const override {
    switch (phase) {
      case Phase::kPrepare:
      case Phase::kUpload:
      case Phase::kLaunch:
      case Phase::kDownload:
        return {Provenance::kPublished};
      case Phase::kExecute:
        return {Provenance::kModelled};
      case Phase::kDeviceInit:
      case Phase::kCall:
        break;
    }
    return {Provenance::kCounted};
  }
  [[nodiscard]] bool is_deterministic() const override { return true; }

 private:
  [[nodiscard]] std::unique_ptr<Kernel> make_kernel(const Workload& workload,
                                                    std::span<const Tensor> parameters) override {
    if (session_.use_count() == 1) session_->free_all();  // of kernels that are gone
    auto call = dsp::find_kernel(workload.kernel)->make(*session_, workload, parameters);
    clock_.advance(model_.copy(program_bytes_));
    for (const auto& loaded : call.loaded) clock_.advance(model_.copy(loaded.bytes));
    return std::make_unique<DspKernel>(session_, std::move(call), model_, clock_);
  }

  std::string version_;  ///< Asked first: an emulator that hangs does so here, and not for long.
  std::shared_ptr<dsp::ProgramSession> session_;
  std::size_t program_bytes_;
  dsp::CostModel model_;
  CountedClock clock_;
};

dsp::CostModel model_for(const UnitRequest& request) {
  const auto specs = dsp_options();
  dsp::CostModel model;
  model.clock_hz = 1e6 * request.option(specs[0]);
  model.round_trip_us = request.option(specs[1]);
  model.board_bytes_per_s = 1e9 * request.option(specs[2]);
  model.memory_bytes_per_s = 1e9 * request.option(specs[3]);
  return model;
}

class DspBackend : public Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "dsp"; }
  [[nodiscard]] std::string_view description() const override {
    return "a Hexagon DSP with HVX, emulated by qemu-hexagon; its packets are counted";
  }
  [[nodiscard]] std::vector<Phase> phases() const override {
    return {kAllPhases.begin(), kAllPhases.end()};
  }
  [[nodiscard]] Probe probe() const override {
    const auto tools = dsp::find_tools();
    if (!tools.missing.empty()) return {false, tools.missing, {}};
    try {
      return {true,
              "",
              {{.name = "Hexagon v60, one HVX thread",
                .platform = "qemu-hexagon, packets counted",
                .version = dsp::emulator_version(tools),
                .compute_units = 1}}};
    } catch (const Error& error) {
      return {false, error.what(), {}};
    }
  }
  [[nodiscard]] Support supports(const Workload& workload) const override {
    return dsp_support(workload);
  }
  [[nodiscard]] std::unique_ptr<Device> open(const UnitRequest& request) const override {
    bind_to_cores(request.cores, request.unit);
    const auto tools = dsp::find_tools();
    if (!tools.missing.empty()) throw_environment("backend dsp is unavailable: " + tools.missing);
    return std::make_unique<DspDevice>(tools, model_for(request));
  }
};

}  // namespace

std::unique_ptr<const Backend> make_dsp_backend() { return std::make_unique<DspBackend>(); }

}  // namespace pirt
