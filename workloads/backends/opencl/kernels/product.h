// Products of matrices on devices with local memory of their own (product.cl).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "workloads/backends/opencl/plan/plan.h"

namespace pirt::opencl {

/// weights [channels, terms] by columns [terms, columns] that are gathered out of a buffer.
struct Product {
  std::span<const float> weights;  ///< [channels, terms]
  std::span<const float> bias;     ///< [channels]
  int channels = 0;
  /// Of each term, from the first one of a column.
  std::vector<std::int32_t> offsets = {};
  /// Columns: the pixels of each image. A column's first term is at
  /// image * in_image + y * in_row + x * stride.
  int images = 1, out_h = 1, out_w = 1;
  int in_image = 0, in_row = 0, stride = 1;
  /// An output is at out_offset + image * out_image + channel * out_plane + y * out_pitch + x.
  int out_image = 0, out_plane = 1, out_pitch = 1, out_offset = 0;
  float least = 0;  ///< What no output is below.
};

/// What a work group computes, and an item of it.
struct ProductTile {
  int channels = 0, columns = 0;  ///< Of a group.
  int terms = 0;                  ///< Held in local memory at a time.
  int item_channels = 0, item_columns = 0;

  [[nodiscard]] int items() const { return channels / item_channels * (columns / item_columns); }
  [[nodiscard]] std::size_t local_bytes() const {
    return sizeof(float) * static_cast<std::size_t>(terms) *
           static_cast<std::size_t>(channels + columns);
  }
};

/// The tile that such a product has least waste with.
[[nodiscard]] const ProductTile& tile_for(int channels, std::int64_t columns);

/// Terms of a piece, a multiple of the tile's, so that there are about @p groups groups.
[[nodiscard]] int terms_of_a_piece(const ProductTile& tile, int channels, std::int64_t columns,
                                   int terms, int groups);

/// Appends the launches that compute it.
/// @return  False, and nothing, where the device computes on the host's cores, or has no room for a
/// group.
[[nodiscard]] bool append_product(PlanBuilder& builder, const Product& product,
                                  const DeviceTensor& in, const DeviceTensor& out);

}  // namespace pirt::opencl
