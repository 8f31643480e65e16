// What the workload bundle_adjust takes and makes; what it computes is in workloads.h.
#pragma once

#include <vector>

#include "workloads/model/workload.h"

namespace pirt::mapping {

/// What its lists have room for: the job of the paper's Section V.
inline constexpr int kRoomForImages = 100;
inline constexpr int kRoomForPoints = 5000;
inline constexpr int kRoomForObservations = 50'000;

/// Rotation and translation of a camera, the first of the numbers that bal.h has of it.
inline constexpr std::size_t kPoseSize = 6;

/// A camera's expected centre and turn, each with its weight, as PosePrior has them.
inline constexpr std::size_t kPriorSize = 8;

/// Relative poses: a pair that is mounted together for each two images, and the step to the next.
inline constexpr int kRoomForRelative = 2 * kRoomForImages;
/// Of one, as RelativePose has it: turn, move and the weights.
inline constexpr std::size_t kRelativeSize = 8;

/// Of all(), in its order: everything but the functions and the operation.
[[nodiscard]] std::vector<Workload> specs();

}  // namespace pirt::mapping
