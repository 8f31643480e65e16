#include "workloads/backends/opencl/kernels/convolution.h"

#include <limits>
#include <vector>

#include "workloads/backends/opencl/kernels/packing.h"
#include "workloads/backends/opencl/kernels/tiles.h"

namespace pirt::opencl {
namespace {

/// What no sum is left below.
float floor_of(const Convolution& convolution) {
  return convolution.relu ? 0.0F : -std::numeric_limits<float>::infinity();
}

/// The channels of a block side by side.
cl::Buffer packed(PlanBuilder& builder, std::span<const float> values, int out_c, int channels) {
  const auto interleaved = interleave_channels(values, out_c, channels);
  return builder.constant(std::as_bytes(std::span(interleaved)));
}

/// Where the pixel of each term of a sum is, from the first one of an output's window.
std::vector<cl_int> term_offsets(const dnn::ConvShape& s, const DeviceTensor& in) {
  std::vector<cl_int> offsets;
  for (int c = 0; c < s.in_c; ++c) {
    for (int y = 0; y < s.k_h; ++y) {
      for (int x = 0; x < s.k_w; ++x) offsets.push_back(c * in.plane() + y * in.pitch() + x);
    }
  }
  return offsets;
}

void append_tiles(PlanBuilder& builder, const ConvTile& tile, const Convolution& convolution,
                  const DeviceTensor& in, const DeviceTensor& out) {
  const dnn::ConvShape& s = convolution.shape;
  const auto offsets = term_offsets(s, in);
  builder.step(
      "tiles.cl", "conv2d_relu_tile",
      {.x = static_cast<std::int64_t>(tile.items) * blocks(s.out_h() * s.out_w(), tile.pixels),
       .y = std::int64_t{convolution.images} * blocks(s.out_c, ConvTile::kChannels),
       .group = tile.items},
      in, packed(builder, convolution.weights, s.out_c, ConvTile::kChannels),
      packed(builder, convolution.bias, s.out_c, ConvTile::kChannels), out,
      builder.constant(std::as_bytes(std::span(offsets))),
      static_cast<std::int32_t>(offsets.size()), in.pitch(), s.stride, s.out_c, s.out_h(),
      s.out_w(), out.plane(), out.pitch(), out.offset(), s.in_c * in.plane(), s.out_c * out.plane(),
      floor_of(convolution), tile.pixel_memory, tile.weight_memory);
}

}  // namespace

void append_convolution(PlanBuilder& builder, const Convolution& convolution,
                        const DeviceTensor& in, const DeviceTensor& out) {
  if (!builder.session().is_cpu) {
    if (const ConvTile tile(builder); tile.fits()) {
      append_tiles(builder, tile, convolution, in, out);
      return;
    }
  }
  const dnn::ConvShape& s = convolution.shape;
  const int channels = builder.session().value(Parameter::kConvChannels);
  const int pixels = builder.session().value(Parameter::kConvPixels);
  builder.step("dnn.cl", "conv2d_relu",
               {.x = blocks(s.out_h() * s.out_w(), pixels),
                .y = std::int64_t{convolution.images} * blocks(s.out_c, channels)},
               in, packed(builder, convolution.weights, s.out_c, channels),
               packed(builder, convolution.bias, s.out_c, channels), out, s.in_c, in.plane(),
               in.pitch(), s.k_h, s.k_w, s.stride, s.out_c, s.out_h(), s.out_w(), out.plane(),
               out.pitch(), out.offset(), s.in_c * in.plane(), s.out_c * out.plane(),
               floor_of(convolution));
}

}  // namespace pirt::opencl
