// How a picture is cut into work items by the kernels that slide down strips (strips.cl).
#pragma once

#include <algorithm>
#include <cstdint>

#include "workloads/backends/opencl/kernels/packing.h"
#include "workloads/backends/opencl/plan/plan.h"
#include "workloads/vision/vision.h"

namespace pirt::opencl {

/// Segments of 16 columns by strips of rows.
struct Strips {
  static constexpr int kColumns = 16;
  /// Pictures of fewer columns go pixel by pixel (strips.cl).
  static constexpr int kNarrow = kColumns + 3;
  /// Mesa's llvmpipe ends an item's loops, without a word, once they have gone round 65,535 times
  /// together: of 35 rows of 16 pixels of filter7x7, with their 49 taps, the last were missing.
  /// @source Mesa, lp_bld_limits.h: LP_MAX_TGSI_LOOP_ITERATIONS.
  static constexpr int kMostNarrowRows = 8;

  /// @param strip_rows  At least 1; of the session's tuning.
  Strips(int strip_rows, const vision::ImageOperation& operation)
      : rows(operation.width < kNarrow ? std::min(strip_rows, kMostNarrowRows) : strip_rows),
        extent{.x = blocks(operation.width, kColumns), .y = blocks(operation.height, rows)} {}

  std::int32_t rows;  ///< Of a strip.
  Extent extent;
};

}  // namespace pirt::opencl
