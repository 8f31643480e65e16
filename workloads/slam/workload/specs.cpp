#include "workloads/slam/workload/specs.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "workloads/slam/workload/recording.h"
#include "workloads/slam/workload/state_tensors.h"

namespace pirt::slam {
namespace {

constexpr int kPropagateFrames = 8;
// Far beyond what there is, and near enough that no square and no difference overflows.
constexpr Range kTurnRate{-1e4, 1e4}, kAcceleration{-1e6, 1e6}, kPixel{-1e9, 1e9},
    kMetres{-1e9, 1e9};
constexpr Range kWord{-0x1p31, 0x1p31 - 1}, kHighWord{-0x1p30, 0x1p30 - 1};  ///< Of a time.

Workload make(const char* name, const char* text, const Setup& setup,
              std::vector<TensorSpec> inputs, std::vector<TensorSpec> outputs) {
  Workload w;
  w.name = name;
  w.description = text;
  w.tags = {"slam"};
  w.kernel = name;
  w.inputs = std::move(inputs);
  w.outputs = std::move(outputs);
  w.state = StateSpec{.name = "slam", .tensors = state_specs(setup)};
  return w;
}

}  // namespace

Setup recorded_setup() {
  CameraModel camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 400;
  camera.cx = 319.5;
  camera.cy = 239.5;
  camera.rate_hz = 1 / Recording::kFrame_s;
  // Looks forward: z of the camera along x of the body.
  camera.body_from_camera.rotation << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  camera.body_from_camera.position = {0.1, 0.02, 0.03};
  Setup setup;
  setup.cameras = {camera};
  setup.imu = ImuModel{};
  return setup;
}

std::int64_t most_tracks(const Setup& setup) { return setup.most_tracks + setup.most_landmarks; }

std::vector<TensorSpec> sample_specs() {
  return {{"samples",
           Element::kF64,
           {kMostSamples, 6},
           true,
           {kTurnRate, kTurnRate, kTurnRate, kAcceleration, kAcceleration, kAcceleration}},
          {"stamps", Element::kI32, {kMostSamples, 2}, true, {kWord, kHighWord}},
          {"until", Element::kI32, {2}, false, {kWord, kHighWord}}};
}

std::vector<TensorSpec> feature_specs() {
  return {{"pixels", Element::kF32, {kMostFeatures, 2}, true, {kPixel}},
          {"scores", Element::kF32, {kMostFeatures}, true},
          {"descriptors", Element::kU8, {kMostFeatures, 32}, true}};
}

std::vector<TensorSpec> better_specs() {
  return {{"better", Element::kF64, {kMostBetter, std::int64_t{kBetterSize}}, true, {kMetres}},
          {"better_ids", Element::kI32, {kMostBetter, 6}, true},
          {"better_descriptors", Element::kU8, {kMostBetter, 32}, true},
          {"better_world", Element::kI32, {1}}};
}

std::vector<TensorSpec> track_specs(const Setup& setup, const std::string& side) {
  const std::int64_t most = most_tracks(setup);
  return {{side + "tracks", Element::kF32, {most, 2}, true, {kPixel}},
          {side + "found", Element::kU8, {most}, true}};
}

std::vector<Workload> specs(const Setup& setup) {
  const std::int64_t most = most_tracks(setup);
  const TensorSpec pose{"pose", Element::kF32, {12}};
  std::vector<TensorSpec> seen = track_specs(setup);
  for (const auto& more : {track_specs(setup, "right_"), feature_specs()}) {
    seen.insert(seen.end(), more.begin(), more.end());
  }
  std::vector<Workload> all;
  all.push_back(make("imu_propagate", "IMU samples at 200 Hz move pose and covariance on", setup,
                     sample_specs(),
                     {pose,
                      {"sigma", Element::kF32, {kMotionSize}},
                      {"points", Element::kF32, {most, 2}, true},
                      {"guesses", Element::kF32, {most, 2}, true},
                      {"depths", Element::kF64, {most}, true}}));
  all.push_back(make(
      "update_pose", "tracks and features of a frame correct the pose", setup, std::move(seen),
      {pose, {"covariance", Element::kF32, {3, 3}}, {"report", Element::kI32, {kReportSize}}}));
  std::vector<TensorSpec> extends = feature_specs();
  std::ranges::copy(better_specs(), std::back_inserter(extends));
  all.push_back(make("extend_map", "tracks of a frame become landmarks, corners become tracks",
                     setup, std::move(extends),
                     {{"landmarks", Element::kF32, {setup.most_landmarks, 3}, true},
                      {"counts", Element::kI32, {5}},
                      {"body", Element::kF64, {12}},
                      {"body_covariance", Element::kF64, {3, 3}},
                      {"status", Element::kI32, {2}}}));
  return all;
}

std::vector<Workload> specs() {
  auto all = specs(recorded_setup());
  all[0].frames = kPropagateFrames;
  return all;
}

}  // namespace pirt::slam
