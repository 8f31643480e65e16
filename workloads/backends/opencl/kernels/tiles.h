// How work is cut into groups by the kernels of tiles.cl, and what local memory these need.
#pragma once

#include <cstddef>
#include <cstdint>

#include "workloads/backends/opencl/kernels/packing.h"
#include "workloads/backends/opencl/plan/plan.h"
#include "workloads/vision/vision.h"

namespace pirt::opencl {

/// A group's columns by `rows` rows of a picture, with what its stencil reaches around them.
struct PictureTiles {
  /// @param tile_rows  Fewer where the local memory would make the group smaller.
  /// @param reach      At least 1.
  PictureTiles(PlanBuilder& builder, const char* kernel, int tile_rows, int reach,
               const vision::ImageOperation& operation)
      : rows(tile_rows) {
    const auto items_of = [&](LocalNeed need) {
      return builder.group_items("tiles.cl", kernel, need);
    };
    const std::size_t most = items_of({});
    while (rows > 1 && items_of(need_of(rows, reach)) < most) rows /= 2;
    const LocalNeed need = need_of(rows, reach);
    const std::size_t items = items_of(need);
    extent = {.x = operation.width, .y = blocks(operation.height, rows), .group = items};
    memory = need.of(items);
  }

  std::int32_t rows;
  Extent extent;
  LocalMemory memory;

 private:
  static LocalNeed need_of(int rows, int reach) {
    const auto staged = static_cast<std::size_t>(rows + 2 * reach);
    return {.per_item = staged, .per_group = 2 * static_cast<std::size_t>(reach) * staged};
  }
};

}  // namespace pirt::opencl
