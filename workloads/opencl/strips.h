// How a picture is cut into work items by the kernels of vision.cl.
#pragma once

#include <cstdint>

#include "workloads/opencl/plan.h"
#include "workloads/vision/vision.h"

namespace pirt::opencl {

/// Segments of 16 columns by strips of rows.
struct Strips {
  static constexpr int kColumns = 16;

  /// A CPU wants few, long items, which share more between rows; a GPU wants thousands.
  Strips(const Session& session, const vision::ImageOperation& operation)
      : rows(session.is_cpu ? 32 : 4),
        extent{.x = (operation.width + kColumns - 1) / kColumns,
               .y = (operation.height + rows - 1) / rows} {}

  std::int32_t rows;  ///< Of a strip; a multiple of 4, which filter7x7 computes at once.
  Extent extent;
};

}  // namespace pirt::opencl
