// The SLAM's steps as workloads with the named state "slam": what a kernel of theirs has to know.
// extract_features and track_features, which have no state, are in vision/.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "workloads/model/workload.h"
#include "workloads/slam/filter/state.h"

namespace pirt::slam {

/// One of the steps.
struct FilterStep : Operation {
  Setup setup;
  /// Advances the state by the call's inputs.
  /// @param outputs  As the workload's, but f64 where those are f32; rows of lists are set.
  void (*run)(State& state, const Setup& setup, std::span<const Tensor> inputs,
              std::span<Tensor> outputs) = nullptr;

  [[nodiscard]] std::string_view host_only() const override { return kHostFunction; }
};

/// The steps of a robot of @p setup, whose shared state is "slam" (state_tensors.h). Kernel and
/// workload have the same name; n is most_tracks(setup), formats are those of step_tensors.h:
/// - "imu_propagate": the IMU's samples up to a frame, or none. Outputs pose f32 [12] (rotation
///   body to world by rows, then position in metres), sigma f32 [15], the root of the covariance's
///   diagonal (state.h has the order), and what tracking needs: points f32 [<=n,2] and guesses f32
///   [<=n,2] (pixels in the frame before and in this one), depths f64 [<=n] (metres, 0 = unknown).
/// - "update_pose": one frame. Inputs tracks f32 [<=n,2] and found u8 [<=n] for the state's tracks
///   in their order (no row: none was found), right_tracks and right_found likewise (no row: no
///   second picture), and extract_features' three lists. Outputs pose f32 [12], covariance of the
///   position f32 [3,3] (m^2), report i32 [7].
/// - "extend_map": one frame. Inputs extract_features' lists and those of better_specs(). Outputs
///   landmarks f32 [<=100,3] (m), counts i32 [5] (tracks, map points; of better points replaced,
///   added, refused), and what the frame leaves: body f64 [12] as pose,
///   body_covariance f64 [3,3] (m^2), status i32 [2] (Status; 1 = in the known map's world).
[[nodiscard]] std::vector<Workload> steps(const Setup& setup);

/// The same on a robot with one camera (640x480) and an IMU, as the catalog has them, each
/// beginning with what it finds at one moment of a recorded flight of 3.6 s through a room of
/// random points, with exact truth. Measured alone they are 8 frames of 8 samples, and one frame
/// each.
///
/// Verified against the same steps without tensors between them: 1e-6 of each output's peak,
/// integers exactly; and against the truth: poses to 5 cm and 0.5 degrees (update_pose begins 14 cm
/// off), landmarks as points of the room (extend_map begins with half of them).
[[nodiscard]] std::vector<Workload> all();

}  // namespace pirt::slam
