#include "workloads/backends/opencl/kernels/convolution.h"

#include <limits>
#include <vector>

#include "workloads/backends/opencl/kernels/packing.h"
#include "workloads/backends/opencl/kernels/product.h"

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

/// As a product: a column is an output pixel, a term a tap of a channel.
Product product_of(const Convolution& convolution, const DeviceTensor& in,
                   const DeviceTensor& out) {
  const dnn::ConvShape& s = convolution.shape;
  Product product{.weights = convolution.weights,
                  .bias = convolution.bias,
                  .channels = s.out_c,
                  .images = convolution.images,
                  .out_h = s.out_h(),
                  .out_w = s.out_w(),
                  .in_image = s.in_c * in.plane(),
                  .in_row = s.stride * in.pitch(),
                  .stride = s.stride,
                  .out_image = s.out_c * out.plane(),
                  .out_plane = out.plane(),
                  .out_pitch = out.pitch(),
                  .out_offset = out.offset(),
                  .least = floor_of(convolution)};
  for (int c = 0; c < s.in_c; ++c) {
    for (int y = 0; y < s.k_h; ++y) {
      for (int x = 0; x < s.k_w; ++x) {
        product.offsets.push_back(c * in.plane() + y * in.pitch() + x);
      }
    }
  }
  return product;
}

}  // namespace

void append_convolution(PlanBuilder& builder, const Convolution& convolution,
                        const DeviceTensor& in, const DeviceTensor& out) {
  if (append_product(builder, product_of(convolution, in, out), in, out)) return;
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
