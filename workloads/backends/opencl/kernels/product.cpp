#include "workloads/backends/opencl/kernels/product.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>

#include "workloads/backends/opencl/kernels/packing.h"

namespace pirt::opencl {
namespace {

// Found by trying on an H200, whose tensor cores nothing of this uses: large parts an item, so that
// local memory keeps up with the arithmetic. The last one is for few columns: batches of images.
constexpr std::array kTiles = {
    ProductTile{.channels = 128, .columns = 64, .terms = 16, .item_channels = 8, .item_columns = 8},
    ProductTile{.channels = 96, .columns = 64, .terms = 24, .item_channels = 8, .item_columns = 4},
    ProductTile{.channels = 64, .columns = 64, .terms = 16, .item_channels = 8, .item_columns = 4},
    ProductTile{.channels = 32, .columns = 64, .terms = 16, .item_channels = 4, .item_columns = 4},
    ProductTile{
        .channels = 128, .columns = 16, .terms = 16, .item_channels = 4, .item_columns = 4}};
constexpr std::int64_t kFewColumns = 32;

/// Groups of one piece.
std::int64_t tiles_of(const ProductTile& tile, int channels, std::int64_t columns) {
  return blocks(channels, tile.channels) * blocks(columns, tile.columns);
}

/// Whether the device of @p session has room for a group of such a tile.
bool fits(const DeviceSession& session, const ProductTile& tile) {
  return static_cast<std::size_t>(tile.items()) <= most_items(session.device) &&
         tile.local_bytes() <= session.device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
}

}  // namespace

const ProductTile& tile_for(int channels, std::int64_t columns) {
  if (columns <= kFewColumns) return kTiles.back();
  return *std::ranges::min_element(kTiles.begin(), kTiles.end() - 1, {},
                                   [channels](const ProductTile& tile) {
                                     return blocks(channels, tile.channels) * tile.channels;
                                   });
}

int terms_of_a_piece(const ProductTile& tile, int channels, std::int64_t columns, int terms,
                     int groups) {
  const auto pieces = std::max<std::int64_t>(1, groups / tiles_of(tile, channels, columns));
  const auto wished =
      static_cast<int>(blocks(terms, static_cast<int>(std::min<std::int64_t>(pieces, terms))));
  // Two tiles at least: of one, nothing is fetched ahead.
  return std::max(pieces > 1 ? 2 : 1, blocks(wished, tile.terms)) * tile.terms;
}

bool append_product(PlanBuilder& builder, const Product& product, const DeviceTensor& in,
                    const DeviceTensor& out) {
  const std::int64_t columns = std::int64_t{product.images} * product.out_h * product.out_w;
  const ProductTile& tile = tile_for(product.channels, columns);
  const DeviceSession& session = builder.session();
  if (session.is_cpu || !fits(session, tile)) return false;
  const auto terms = static_cast<int>(product.offsets.size());
  const int groups = session.value(Parameter::kProductGroups) *
                     static_cast<int>(session.device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>());
  const int piece = terms_of_a_piece(tile, product.channels, columns, terms, groups);
  const int pieces = blocks(terms, piece);
  const int rows = blocks(product.channels, tile.channels) * tile.channels;
  const auto in_a_row = static_cast<int>(blocks(columns, tile.columns) * tile.columns);
  const bool fuses = (session.device.getInfo<CL_DEVICE_SINGLE_FP_CONFIG>() & CL_FP_FMA) != 0;
  const Source source("product.cl",
                      fmt::format(" -DTILE_CHANNELS={} -DTILE_COLUMNS={} -DTILE_TERMS={} "
                                  "-DITEM_CHANNELS={} -DITEM_COLUMNS={}{}",
                                  tile.channels, tile.columns, tile.terms, tile.item_channels,
                                  tile.item_columns, fuses ? " -DFUSED" : ""));
  const auto interleaved = interleave_channels(product.weights, product.channels, tile.channels);
  const auto weights = builder.constant(std::as_bytes(std::span(interleaved)));
  const auto bias = builder.constant(std::as_bytes(product.bias));
  const auto offsets = builder.constant(std::as_bytes(std::span(product.offsets)));
  const cl::Buffer sums =
      pieces > 1
          ? builder.scratch(std::int64_t{pieces} * rows * in_a_row * std::int64_t{sizeof(float)})
          : out.buffer;
  const auto items = static_cast<std::size_t>(tile.items());
  builder.step(source, "product",
               {.x = static_cast<std::int64_t>(items) * tiles_of(tile, product.channels, columns),
                .y = pieces,
                .group = items},
               in, weights, bias, offsets, sums, terms, piece, product.channels,
               static_cast<std::int32_t>(columns), product.in_image, product.in_row, product.stride,
               product.out_h * product.out_w, product.out_w, product.out_image, product.out_plane,
               product.out_pitch, product.out_offset, product.least);
  if (pieces == 1) return true;
  builder.step(source, "sum_pieces", {.x = columns, .y = product.channels}, sums, bias, out, pieces,
               rows, in_a_row, static_cast<std::int32_t>(columns), product.out_h * product.out_w,
               product.out_w, product.out_image, product.out_plane, product.out_pitch,
               product.out_offset, product.least);
  return true;
}

}  // namespace pirt::opencl
