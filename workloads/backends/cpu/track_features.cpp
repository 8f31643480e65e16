// track_features on the host's cores: the robot's own tracker (vision/pyramid.h), its points over
// the unit's threads. cv::calcOpticalFlowPyrLK takes other derivatives, rounds samples to integers
// and does not follow back.
#include <array>
#include <memory>
#include <utility>

#include "workloads/backends/cpu/kernels.h"
#include "workloads/vision/pyramid.h"
#include "workloads/vision/vision.h"

namespace pirt::cpu {
namespace {

class TrackFeatures : public Kernel {
 public:
  TrackFeatures(const vision::TrackFeatures& operation, std::shared_ptr<BandTeam> team)
      : operation_(operation), team_(std::move(team)) {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    inputs_ = inputs;
    outputs_ = outputs;
  }

  std::optional<Nanos> execute(int repeats) override {
    for (int i = 0; i < repeats; ++i) compute();
    return std::nullopt;
  }

 private:
  void compute() {
    // A level needs all of the one below: the two pictures are the parts.
    std::array<slam::Pyramid, 2> pyramids;
    for_bands(*team_, static_cast<int>(pyramids.size()), Halo(0), [&](const Band& band) {
      for (auto i = static_cast<std::size_t>(band.rows.start); std::cmp_less(i, band.rows.end);
           ++i) {
        const auto pixels = inputs_[i].as<std::uint8_t>();
        pyramids[i] = slam::make_pyramid(
            {operation_.width, operation_.height, {pixels.begin(), pixels.end()}},
            vision::TrackFeatures::kLevels);
      }
    });
    const auto points = inputs_[2].used<float>();
    for (Tensor& output : outputs_) output.set_rows(inputs_[2].rows());
    const auto tracks = outputs_[0].as<float>();
    const auto status = outputs_[1].as<std::uint8_t>();
    for_bands(*team_, static_cast<int>(inputs_[2].rows()), Halo(0), [&](const Band& band) {
      for (auto i = static_cast<std::size_t>(band.rows.start); std::cmp_less(i, band.rows.end);
           ++i) {
        const Eigen::Vector2f p(points[2 * i], points[2 * i + 1]);
        const auto tracked = slam::track_feature(pyramids[0], pyramids[1], p, p, {});
        const Eigen::Vector2f& q = tracked.found ? tracked.pixel : p;
        tracks[2 * i] = q.x();
        tracks[2 * i + 1] = q.y();
        status[i] = tracked.found ? 1 : 0;
      }
    });
  }

  vision::TrackFeatures operation_;
  std::shared_ptr<BandTeam> team_;
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
};

}  // namespace

std::unique_ptr<Kernel> make_track_features(const Workload& workload, std::span<const Tensor>,
                                            const std::shared_ptr<BandTeam>& team) {
  return std::make_unique<TrackFeatures>(operation_as<vision::TrackFeatures>(workload), team);
}

}  // namespace pirt::cpu
