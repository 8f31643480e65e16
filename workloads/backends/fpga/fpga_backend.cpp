#include "workloads/backends/fpga/fpga_backend.h"

#include <fmt/core.h>

#include <cmath>
#include <cstring>
#include <map>
#include <string>
#include <utility>

#include "workloads/backends/fpga/board.h"
#include "workloads/backends/fpga/core.h"
#include "workloads/backends/fpga/fpga_options.h"
#include "workloads/backends/fpga/kernels.h"
#include "workloads/base/contract.h"
#include "workloads/base/system/affinity.h"
#include "workloads/model/counted_clock.h"

namespace pirt {
namespace {

Support support_of(const Workload& workload) {
  if (workload.variant == "map") {
    return {false, "backend fpga has a memory of its own: nothing to map"};
  }
  const auto* const entry = fpga::find_kernel(workload.kernel);
  if (entry == nullptr) {
    const std::string_view here =
        workload.operation != nullptr ? workload.operation->host_only() : "";
    return {false, here.empty() ? "backend fpga has no core for '" + workload.kernel + "'"
                                : std::string(here)};
  }
  const std::string fault = entry->fault(*entry, workload);
  return {fault.empty(), fault};
}

/// The board as it is at a time: what has been counted, and which bitstream is loaded.
struct Running {
  fpga::Board board;
  CountedClock clock;
  std::string loaded = {};
  int loads = 0;
  std::map<std::string_view, std::size_t> kept_bytes = {};  ///< In the SDRAM, by bitstream.

  /// What the SDRAM held is gone when a bitstream is loaded: its controller is part of it.
  void load(std::string_view bitstream) {
    if (loaded == bitstream) return;
    loaded = bitstream;
    ++loads;
    clock.advance(board.configuration());
  }
};

class FpgaKernel : public Kernel {
 public:
  FpgaKernel(Running& running, const fpga::FpgaKernelEntry& entry, const Workload& workload,
             std::span<const Tensor> parameters)
      : running_(running),
        bitstream_(entry.bitstream),
        call_(entry.make(workload, parameters)),
        core_(fpga::find_core(call_.core).make()) {
    task_ = {.width = call_.width,
             .height = call_.height,
             .parameters = call_.parameters,
             .in = {},
             .out = {}};
    for (auto& lane : call_.in) task_.in.push_back({lane.memory, lane.bytes});
    out_.resize(call_.out.size());
    for (std::size_t i = 0; i < out_.size(); ++i) {
      out_[i].resize(call_.out[i].size_bytes);
      task_.out.push_back({out_[i], call_.out[i].bytes});
    }
    refuse_more_than_there_is(workload.name);
    alone_ = fpga::cycles_alone(*core_, task_);
    load();
    running_.kept_bytes[bitstream_] += size_bytes();
  }
  ~FpgaKernel() override { running_.kept_bytes[bitstream_] -= size_bytes(); }
  FpgaKernel(const FpgaKernel&) = delete;
  FpgaKernel& operator=(const FpgaKernel&) = delete;

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    inputs_ = inputs;
    outputs_ = outputs;
  }

  void upload() override {
    load();
    if (call_.fill) {
      running_.clock.advance(running_.board.host(call_.fill(inputs_, call_.in)));
    } else {
      for (std::size_t i = 0; i < inputs_.size(); ++i) {
        const auto bytes = inputs_[i].bytes();
        expect(bytes.size() == call_.in[i].call_bytes, "an input of another size than the core's");
        std::memcpy(call_.in[i].memory.data(), bytes.data(), bytes.size());
      }
    }
    move_inputs();
  }

  std::optional<Nanos> execute(int repeats) override {
    const fpga::Board& board = running_.board;
    if (load()) move_inputs();
    for (int i = 0; i < repeats; ++i) {
      const auto cycles = fpga::cycles_with_memory(*core_, task_, board.core_hz(), board.sdram);
      running_.clock.advance(board.launch() + board.cycles(cycles));
    }
    return repeats * board.launch();
  }

  void download() override {
    for (const auto& lane : out_) {
      running_.clock.advance(running_.board.transfer(lane.size(), false));
    }
    if (call_.finish) {
      running_.clock.advance(running_.board.host(call_.finish(out_, outputs_)));
      return;
    }
    for (std::size_t i = 0; i < out_.size(); ++i) {
      expect(outputs_[i].bytes().size() == out_[i].size(),
             "an output of another size than the core's");
      std::memcpy(outputs_[i].data(), out_[i].data(), out_[i].size());
    }
  }

  /// What has been counted of the core, without the model of the memory.
  [[nodiscard]] std::optional<Nanos> bound(Phase phase) const override {
    if (phase != Phase::kExecute) return std::nullopt;
    return running_.board.cycles(alone_);
  }

 private:
  /// The bitstream, where another one is loaded, and what the memory keeps from call to call.
  /// @return whether the memory's content was lost since the last time: the inputs are gone, too.
  bool load() {
    running_.load(bitstream_);
    if (filled_in_ == running_.loads) return false;
    filled_in_ = running_.loads;
    for (const auto& lane : call_.in) {
      if (lane.loaded_bytes > 0) {
        running_.clock.advance(running_.board.transfer(lane.loaded_bytes, true));
      }
    }
    return true;
  }

  void refuse_more_than_there_is(const std::string& name) const {
    constexpr std::size_t kMemory = std::size_t{64} << 20;
    const std::size_t kept = running_.kept_bytes[bitstream_];
    if (kept + size_bytes() > kMemory) {
      throw_environment(
          fmt::format("'{}' needs {} bytes of the board's SDRAM, which has {}, {} of them for what "
                      "is prepared already; prepare less of it at a time",
                      name, size_bytes(), kMemory, kept));
    }
  }

  [[nodiscard]] std::size_t size_bytes() const {
    std::size_t bytes = 0;
    for (const auto& lane : call_.in) bytes += lane.memory.size();
    for (const auto& lane : out_) bytes += lane.size();
    return bytes;
  }

  void move_inputs() {
    for (const auto& lane : call_.in) {
      if (lane.call_bytes > 0) {
        running_.clock.advance(running_.board.transfer(lane.call_bytes, true));
      }
    }
  }

  Running& running_;
  std::string_view bitstream_;
  fpga::Call call_;
  std::unique_ptr<fpga::Core> core_;
  fpga::Task task_;
  std::vector<std::vector<std::byte>> out_;  ///< In the board's memory.
  std::int64_t alone_ = 0;
  int filled_in_ = 0;  ///< Running::loads then.
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
};

DeviceInfo device_info() {
  return {.name = "Cyclone V 5CSEMA5, RTL cores",
          .platform = "Verilator, cycles counted",
          .version = PIRT_FPGA_VERSION,
          .compute_units = 1};
}

class FpgaDevice : public Device {
 public:
  explicit FpgaDevice(const fpga::Board& board) { running_.board = board; }

  [[nodiscard]] DeviceInfo info() const override { return device_info(); }
  [[nodiscard]] Support supports(const Workload& workload) const override {
    return support_of(workload);
  }
  [[nodiscard]] const Clock* own_clock() const override { return &running_.clock; }
  [[nodiscard]] Provenance provenance() const override { return Provenance::kCounted; }
  [[nodiscard]] Accounting accounting(Phase phase) const override {
    switch (phase) {
      case Phase::kDeviceInit:
        return {Provenance::kModelled,
                "no source says what the host's system takes for its drivers"};
      case Phase::kPrepare:
        return {Provenance::kPublished};
      case Phase::kUpload:
      case Phase::kLaunch:
      case Phase::kExecute:
      case Phase::kDownload:
        return {Provenance::kModelled};
      case Phase::kCall:
        break;
    }
    return {Provenance::kCounted};
  }
  [[nodiscard]] bool is_deterministic() const override { return true; }

 private:
  [[nodiscard]] std::unique_ptr<Kernel> make_kernel(const Workload& workload,
                                                    std::span<const Tensor> parameters) override {
    return std::make_unique<FpgaKernel>(running_, *fpga::find_kernel(workload.kernel), workload,
                                        parameters);
  }

  Running running_;
};

fpga::Board board_for(const UnitRequest& request) {
  const auto specs = fpga_options();
  fpga::Board board;
  board.clock_hz = 1e6 * request.option(specs[0]);
  board.sdram.clock_hz = std::llround(1e6 * request.option(specs[1]));
  board.bridge_bits = static_cast<int>(std::lround(request.option(specs[2])));
  board.launch_us = request.option(specs[3]);
  board.configuration_bits_per_s = 8e6 * request.option(specs[4]);
  board.host_hz = 1e6 * request.option(specs[5]);
  return board;
}

class FpgaBackend : public Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "fpga"; }
  [[nodiscard]] std::string_view description() const override {
    return "cores in Verilog for the FPGA of a DE1-SoC, run by Verilator; their cycles are counted";
  }
  [[nodiscard]] std::vector<Phase> phases() const override {
    return {kAllPhases.begin(), kAllPhases.end()};
  }
  [[nodiscard]] Probe probe() const override { return {true, "", {device_info()}}; }
  [[nodiscard]] Support supports(const Workload& workload) const override {
    return support_of(workload);
  }
  [[nodiscard]] std::unique_ptr<Device> open(const UnitRequest& request) const override {
    bind_to_cores(request.cores, request.unit);
    return std::make_unique<FpgaDevice>(board_for(request));
  }
};

}  // namespace

std::unique_ptr<const Backend> make_fpga_backend() { return std::make_unique<FpgaBackend>(); }

}  // namespace pirt
