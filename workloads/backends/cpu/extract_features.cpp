// extract_features on the host's cores: what the SLAM itself calls (slam/features.h), in the
// calling thread.
#include <algorithm>
#include <cstdint>
#include <memory>

#include "workloads/backends/cpu/kernels.h"
#include "workloads/vision/features.h"
#include "workloads/vision/vision.h"

namespace pirt::cpu {
namespace {

class ExtractFeatures : public Kernel {
 public:
  explicit ExtractFeatures(const vision::ExtractFeatures& operation)
      : image_{operation.width, operation.height, {}} {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    input_ = inputs[0].as<std::uint8_t>();
    outputs_ = outputs;
  }

  std::optional<Nanos> execute(int repeats) override {
    for (int i = 0; i < repeats; ++i) compute();
    return std::nullopt;
  }

 private:
  void compute() {
    image_.pixels.assign(input_.begin(), input_.end());
    const auto features =
        slam::extract_features(image_, {.most = vision::ExtractFeatures::kMost,
                                        .cell = vision::ExtractFeatures::kCell,
                                        .threshold = vision::ExtractFeatures::kThreshold});
    for (Tensor& output : outputs_) output.set_rows(std::ssize(features.pixels));
    const auto pixels = outputs_[0].used<float>();
    for (std::size_t i = 0; i < features.pixels.size(); ++i) {
      pixels[2 * i] = features.pixels[i].x();
      pixels[2 * i + 1] = features.pixels[i].y();
    }
    std::ranges::copy(features.scores, outputs_[1].used<float>().begin());
    auto* bits = outputs_[2].used<std::uint8_t>().data();
    for (const auto& descriptor : features.descriptors) {
      bits = std::ranges::copy(descriptor, bits).out;
    }
  }

  GreyImage image_;
  std::span<const std::uint8_t> input_;
  std::span<Tensor> outputs_;
};

}  // namespace

std::unique_ptr<Kernel> make_extract_features(const Workload& workload, std::span<const Tensor>,
                                              const std::shared_ptr<BandTeam>&) {
  return std::make_unique<ExtractFeatures>(operation_as<vision::ExtractFeatures>(workload));
}

}  // namespace pirt::cpu
