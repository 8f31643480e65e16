// background_model on the host's cores: one pass over image and state, in bands of pixels.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

#include "workloads/backends/cpu/kernels.h"
#include "workloads/vision/vision.h"

namespace pirt::cpu {
namespace {

class BackgroundModel : public Kernel {
 public:
  explicit BackgroundModel(std::shared_ptr<BandTeam> team) : team_(std::move(team)) {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    image_ = inputs[0].as<std::uint8_t>();
    mask_ = outputs[0].as<std::uint8_t>();
    height_ = static_cast<int>(inputs[0].dim(0));
  }

  void bind_state(std::span<const Tensor> current, std::span<Tensor> next) override {
    background_ = current[0].as<float>();
    frames_ = current[1].as<std::int32_t>();
    next_background_ = next[0].as<float>();
    next_frames_ = next[1].as<std::int32_t>();
  }

  std::optional<Nanos> execute(int repeats) override {
    for (int i = 0; i < repeats; ++i) compute();
    return std::nullopt;
  }

 private:
  void compute() {
    const int shift = std::clamp(frames_[0], 0, vision::BackgroundModel::kMaxShift);
    const std::size_t width = image_.size() / static_cast<std::size_t>(height_);
    for_bands(*team_, height_, Halo(0), [&](const Band& band) {
      update(static_cast<std::size_t>(band.rows.start) * width,
             static_cast<std::size_t>(band.rows.end) * width, shift);
    });
    next_frames_[0] = std::min(shift + 1, vision::BackgroundModel::kMaxShift);
  }

  /// Pixels from @p begin to before @p end.
  void update(std::size_t begin, std::size_t end, int shift) const {
    const float rate = std::ldexp(1.0F, -shift);
    // Nothing differs from what was never seen.
    const float threshold =
        shift > 0 ? vision::BackgroundModel::kThreshold : std::numeric_limits<float>::infinity();
    const std::uint8_t* const image = image_.data();
    const float* const background = background_.data();
    std::uint8_t* const mask = mask_.data();
    float* const next = next_background_.data();
    for (std::size_t i = begin; i < end; ++i) {
      const float difference = static_cast<float>(image[i]) - background[i];
      next[i] = background[i] + difference * rate;
      mask[i] = std::abs(difference) > threshold ? 255 : 0;
    }
  }

  std::shared_ptr<BandTeam> team_;
  int height_ = 1;
  std::span<const std::uint8_t> image_;
  std::span<std::uint8_t> mask_;
  std::span<const float> background_;
  std::span<const std::int32_t> frames_;
  std::span<float> next_background_;
  std::span<std::int32_t> next_frames_;
};

}  // namespace

std::unique_ptr<Kernel> make_background_model(const Workload& workload, std::span<const Tensor>,
                                              const std::shared_ptr<BandTeam>& team) {
  static_cast<void>(operation_as<vision::BackgroundModel>(workload));
  return std::make_unique<BackgroundModel>(team);
}

}  // namespace pirt::cpu
