// What the SLAM's workloads take and make; what they compute is in workloads.h.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "workloads/model/workload.h"
#include "workloads/slam/filter/state.h"

namespace pirt::slam {

inline constexpr std::int64_t kMostSamples = 1024;  ///< Of an IMU, in one call.
inline constexpr std::int64_t kMostFeatures = 400;
inline constexpr int kReportSize = 7;  ///< The numbers of a FrameReport, in their order.

/// Tracks that a state may have: landmarks that are known again are followed beyond the others'
/// number.
[[nodiscard]] std::int64_t most_tracks(const Setup& setup);

/// samples f64 [<=1024,6] (rad/s, m/s^2), stamps i32 [<=1024,2] and until i32 [2] (nanoseconds, low
/// and high word).
[[nodiscard]] std::vector<TensorSpec> sample_specs();
/// The three lists of extract_features.
[[nodiscard]] std::vector<TensorSpec> feature_specs();
inline constexpr std::int64_t kMostBetter =
    2000;                                       ///< Points of a map that are known better, a call.
inline constexpr std::size_t kBetterSize = 15;  ///< Position, covariance by rows, seen from.

/// better f64 [<=2000,15], better_ids i32 [<=2000,6] (id, last frame, milestone; low, high words),
/// better_descriptors u8 [<=2000,32] and better_world i32 [1] (1 = the known map's).
[[nodiscard]] std::vector<TensorSpec> better_specs();
/// Pixels f32 [<=n,2] and found u8 [<=n], n of most_tracks(). @param side  Before the names: "" or
/// "right_".
[[nodiscard]] std::vector<TensorSpec> track_specs(const Setup& setup, const std::string& side = "");

/// The robot's of the recorded flight: one camera (640x480) and an IMU.
[[nodiscard]] Setup recorded_setup();

/// Of steps(), in its order: everything but the functions and the operation.
[[nodiscard]] std::vector<Workload> specs(const Setup& setup);
/// Of all().
[[nodiscard]] std::vector<Workload> specs();

}  // namespace pirt::slam
