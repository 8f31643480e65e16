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
  PictureTiles(const Session& session, int tile_rows, int reach,
               const vision::ImageOperation& operation)
      : rows(tile_rows),
        extent{.x = operation.width, .y = blocks(operation.height, tile_rows)},
        memory{(session.local_x + 2 * static_cast<std::size_t>(reach)) *
               static_cast<std::size_t>(tile_rows + 2 * reach)} {}

  std::int32_t rows;
  Extent extent;
  LocalMemory memory;
};

/// A group's pixels and channels of a convolution.
struct ConvTile {
  static constexpr int kChannels = 32;
  static constexpr int kTerms = 8;

  explicit ConvTile(const Session& session)
      : pixels(static_cast<int>(session.local_x) / 2),
        pixel_memory{sizeof(float) * kTerms * static_cast<std::size_t>(pixels)},
        weight_memory{sizeof(float) * kTerms * kChannels} {}

  /// Whether groups of the session's size can compute it.
  [[nodiscard]] static bool fits(const Session& session) {
    return session.local_x % (kChannels / 4) == 0;
  }

  int pixels;
  LocalMemory pixel_memory, weight_memory;
};

}  // namespace pirt::opencl
