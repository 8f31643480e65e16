// What the SLAM's workloads take and make; what they compute is in workloads.h.
#pragma once

#include <cstdint>
#include <vector>

#include "workloads/slam/state.h"
#include "workloads/workload.h"

namespace pirt::slam {

inline constexpr std::int64_t kMostSamples = 64;
inline constexpr std::int64_t kMostFeatures = 400;

/// The robot's of the recorded flight: one camera (640x480) and an IMU.
[[nodiscard]] Setup recorded_setup();

/// The three lists of extract_features.
[[nodiscard]] std::vector<TensorSpec> feature_specs();

/// Of all(), in its order: everything but the functions and the operation.
[[nodiscard]] std::vector<Workload> specs();

}  // namespace pirt::slam
