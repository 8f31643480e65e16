// The SLAM's steps on one of the host's cores: the same functions that a run without tensors calls
// (slam/steps.h), between reading and writing the state.
#include <algorithm>
#include <array>
#include <memory>

#include "workloads/backends/cpu/kernels.h"
#include "workloads/slam/workload/state_tensors.h"
#include "workloads/slam/workload/workloads.h"

namespace pirt::cpu {
namespace {

class SlamStep : public Kernel {
 public:
  explicit SlamStep(const Workload& workload) : step_(operation_as<slam::FilterStep>(workload)) {
    auto specs = workload.outputs;
    for (TensorSpec& spec : specs) {
      if (spec.element == Element::kF32) spec.element = Element::kF64;
    }
    wide_ = make_tensors(specs);
  }

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    inputs_ = inputs;
    outputs_ = outputs;
  }
  void bind_state(std::span<const Tensor> current, std::span<Tensor> next) override {
    current_ = current;
    next_ = next;
  }

  std::optional<Nanos> execute(int repeats) override {
    for (int i = 0; i < repeats; ++i) compute();
    return std::nullopt;
  }

 private:
  void compute() {
    slam::State state = slam::read_state(current_);
    step_.run(state, step_.setup, inputs_, wide_);
    slam::write_state(state, next_);
    for (std::size_t i = 0; i < wide_.size(); ++i) {
      if (wide_[i].spec().element == outputs_[i].spec().element) {
        copy_tensor(wide_[i], outputs_[i]);
        continue;
      }
      if (wide_[i].spec().varies) outputs_[i].set_rows(wide_[i].rows());
      std::ranges::transform(wide_[i].used<double>(), outputs_[i].as<float>().begin(),
                             [](double value) { return static_cast<float>(value); });
    }
  }

  slam::FilterStep step_;
  std::vector<Tensor> wide_;  ///< The outputs in f64.
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
  std::span<const Tensor> current_;
  std::span<Tensor> next_;
};

std::unique_ptr<Kernel> make_step(const Workload& workload, std::span<const Tensor>,
                                  const std::shared_ptr<BandTeam>&) {
  return std::make_unique<SlamStep>(workload);
}

constexpr std::array kSlamKernels = {
    CpuKernelEntry{"imu_propagate", make_step},
    CpuKernelEntry{"update_pose", make_step},
    CpuKernelEntry{"extend_map", make_step},
};

}  // namespace

std::span<const CpuKernelEntry> slam_kernels() { return kSlamKernels; }

}  // namespace pirt::cpu
