#include "scheduler/robot/tracking.h"

#include <initializer_list>

#include "workloads/slam/workload/step_tensors.h"

namespace pirt {
namespace {

constexpr std::size_t kLevels = slam::kPyramidLevels;

void pyramid(std::span<const Tensor> inputs, std::span<Tensor> outputs) {
  slam::write_pyramid(slam::make_pyramid(slam::image_of(inputs[0])), outputs);
}

void track(std::span<const Tensor> inputs, std::span<Tensor> outputs) {
  const auto from = slam::pyramid_of(inputs.first(kLevels));
  const auto to = slam::pyramid_of(inputs.subspan(kLevels, kLevels));
  const auto points = slam::points_of(inputs[2 * kLevels]);
  const auto guesses = slam::points_of(inputs[2 * kLevels + 1]);
  slam::write_tracks(slam::track_features(from, to, points, guesses, {}), outputs);
}

void track_right(const slam::Setup& setup, std::span<const Tensor> inputs,
                 std::span<Tensor> outputs) {
  const auto left = slam::pyramid_of(inputs.first(kLevels));
  const auto right = slam::pyramid_of(inputs.subspan(kLevels, kLevels));
  const auto tracks = slam::tracks_of(inputs.subspan(2 * kLevels, 2));
  const auto request = slam::request_right(setup, inputs[2 * kLevels + 2].used<double>(), tracks);
  slam::write_tracks(slam::track_features(left, right, request.pixels, request.guesses, {}),
                     outputs);
}

}  // namespace

std::vector<OwnWorkload> tracking_workloads(const slam::Setup& setup) {
  const auto joined = [](std::initializer_list<std::vector<TensorSpec>> parts) {
    std::vector<TensorSpec> all;
    for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
    return all;
  };
  const std::int64_t most = slam::most_tracks(setup);
  const TensorSpec points{"points", Element::kF32, {most, 2}, true};
  const TensorSpec guesses{"guesses", Element::kF32, {most, 2}, true};
  const TensorSpec depths{"depths", Element::kF64, {most}, true};
  const auto tracks = slam::track_specs(setup);
  std::vector<OwnWorkload> own;
  std::vector<std::vector<TensorSpec>> levels;
  for (const auto& camera : setup.cameras) {
    levels.push_back(slam::pyramid_specs(camera.width, camera.height));
    own.push_back({.name = own.empty() ? "pyramid" : "pyramid_right",
                   .inputs = {slam::image_spec(camera.width, camera.height)},
                   .outputs = levels.back(),
                   .kernels = {{"cpu", pyramid}}});
  }
  own.push_back({.name = "track",
                 .inputs = joined({levels[0], levels[0], {points, guesses}}),
                 .outputs = tracks,
                 .kernels = {{"cpu", track}}});
  if (setup.cameras.size() < 2) return own;
  const auto right = [setup](std::span<const Tensor> inputs, std::span<Tensor> outputs) {
    track_right(setup, inputs, outputs);
  };
  own.push_back({.name = "track_right",
                 .inputs = joined({levels[0], levels[1], tracks, {depths}}),
                 .outputs = tracks,
                 .kernels = {{"cpu", right}}});
  return own;
}

}  // namespace pirt
