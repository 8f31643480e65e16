#include "workloads/slam/specs.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "workloads/slam/recording.h"
#include "workloads/slam/state_tensors.h"

namespace pirt::slam {
namespace {

constexpr int kPropagateFrames = 8;

Workload make(const char* name, const char* text, std::vector<TensorSpec> outputs) {
  Workload w;
  w.name = name;
  w.description = text;
  w.tags = {"slam"};
  w.kernel = name;
  w.outputs = std::move(outputs);
  w.state = StateSpec{.name = "slam", .tensors = state_specs(recorded_setup())};
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

std::vector<TensorSpec> feature_specs() {
  return {{"pixels", Element::kF32, {kMostFeatures, 2}, true},
          {"scores", Element::kF32, {kMostFeatures}, true},
          {"descriptors", Element::kU8, {kMostFeatures, 32}, true}};
}

std::vector<Workload> specs() {
  const Setup setup = recorded_setup();
  const std::int64_t most = setup.most_tracks + setup.most_landmarks;
  const TensorSpec pose{"pose", Element::kF32, {12}};
  std::vector<Workload> all;
  all.push_back(make("imu_propagate", "IMU samples at 200 Hz move pose and covariance on",
                     {pose, {"sigma", Element::kF32, {kMotionSize}}}));
  all[0].inputs = {{"samples", Element::kF64, {kMostSamples, 6}, true},
                   {"stamps", Element::kI32, {kMostSamples, 2}, true},
                   {"until", Element::kI32, {2}}};
  all[0].frames = kPropagateFrames;
  all.push_back(
      make("update_pose", "tracks and features of a frame correct the pose",
           {pose, {"covariance", Element::kF32, {3, 3}}, {"report", Element::kI32, {5}}}));
  all[1].inputs = {{"tracks", Element::kF32, {most, 2}, true},
                   {"found", Element::kU8, {most}, true}};
  std::ranges::copy(feature_specs(), std::back_inserter(all[1].inputs));
  all.push_back(make("extend_map", "tracks of a frame become landmarks, corners become tracks",
                     {{"landmarks", Element::kF32, {setup.most_landmarks, 3}, true},
                      {"counts", Element::kI32, {2}}}));
  all[2].inputs = feature_specs();
  return all;
}

}  // namespace pirt::slam
