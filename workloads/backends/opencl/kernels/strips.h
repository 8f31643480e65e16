// How a picture is cut into work items by the kernels that slide down strips (strips.cl).
#pragma once

#include <cstdint>

#include "workloads/backends/opencl/plan/plan.h"
#include "workloads/vision/vision.h"

namespace pirt::opencl {

/// Segments of 16 columns by strips of rows.
struct Strips {
  static constexpr int kColumns = 16;

  /// @param strip_rows  At least 1; of the session's tuning.
  Strips(int strip_rows, const vision::ImageOperation& operation)
      : rows(strip_rows),
        extent{.x = (operation.width + kColumns - 1) / kColumns,
               .y = (operation.height + rows - 1) / rows} {}

  std::int32_t rows;  ///< Of a strip.
  Extent extent;
};

}  // namespace pirt::opencl
