// What the planning workloads take and make; what they compute is in workloads.h.
#pragma once

#include <vector>

#include "workloads/model/workload.h"

namespace pirt::planning {

/// Cells that the workloads' grids have room for. A smaller map has its cells in the upper left
/// corner and unknown ones beside them.
inline constexpr int kMapWidth = 640;
inline constexpr int kMapHeight = 320;
inline constexpr int kWindowSide = 160;
inline constexpr int kMostMoving = 32;
inline constexpr int kFrames = 8;  ///< Of the sequences that the workloads are measured with.

/// Of all(), in its order: everything but the functions and the operation.
[[nodiscard]] std::vector<Workload> specs();

}  // namespace pirt::planning
