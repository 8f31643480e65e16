// The SLAM's steps as workloads with the named state "slam": what a kernel of theirs has to know.
// extract_features and track_features, which have no state, are in vision/.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "workloads/slam/state.h"
#include "workloads/workload.h"

namespace pirt::slam {

/// One of the steps, on a robot with one camera (640x480) and an IMU.
struct Step : Operation {
  Setup setup;
  /// Advances the state by the call's inputs.
  /// @param outputs  f64, as the workload's outputs otherwise; rows of lists are set.
  void (*run)(State& state, const Setup& setup, std::span<const Tensor> inputs,
              std::span<Tensor> outputs) = nullptr;
};

/// Kernel and workload have the same name. All share the state "slam" (state_tensors.h), each
/// beginning with what it finds at one moment of a recorded flight of 3.6 s through a room of
/// random points, with exact truth. Measured alone they are:
/// - "imu_propagate": 8 frames of 8 samples. Inputs samples f64 [<=64,6] (rad/s, m/s^2), stamps
///   i32 [<=64,2] and until i32 [2] (nanoseconds, low and high word). Outputs pose f32 [12]
///   (rotation body to world by rows, then position in metres) and sigma f32 [15], the root of the
///   covariance's diagonal (state.h has the order).
/// - "update_pose": one frame. Inputs tracks f32 [<=250,2] and found u8 [<=250] for the state's
///   tracks in their order, and extract_features' three lists. Outputs pose f32 [12], covariance of
///   the position f32 [3,3] (m^2), report i32 [5] (tracks, landmarks, recognized, points,
///   rejected).
/// - "extend_map": one frame. Inputs extract_features' lists. Outputs landmarks f32 [<=100,3] (m)
///   and counts i32 [2] (tracks, map points).
///
/// Verified against the same steps without tensors between them: 1e-6 of each output's peak,
/// integers exactly; poses against truth too: 20 cm and 2 degrees.
[[nodiscard]] std::vector<Workload> all();

}  // namespace pirt::slam
