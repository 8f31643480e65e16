// AlexNet's layers and the chain of them: weights, arguments and extents of the kernels in dnn.cl
// and, where the device has local memory of its own, tiles.cl.
#include <algorithm>
#include <array>
#include <vector>

#include "workloads/backends/opencl/kernels/batch_kernels.h"
#include "workloads/backends/opencl/kernels/packing.h"
#include "workloads/backends/opencl/kernels/tiles.h"
#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/dnn/dnn.h"

namespace pirt::opencl {
namespace {

constexpr std::string_view kSource = "dnn.cl";
constexpr std::string_view kTiles = "tiles.cl";

/// Where the pixel of each term of a sum is, from the first one of an output's window.
std::vector<cl_int> term_offsets(const dnn::ConvShape& s, const Resident& in) {
  std::vector<cl_int> offsets;
  for (int c = 0; c < s.in_c; ++c) {
    for (int y = 0; y < s.k_h; ++y) {
      for (int x = 0; x < s.k_w; ++x) offsets.push_back(c * in.plane() + y * in.pitch() + x);
    }
  }
  return offsets;
}

void append_conv2d_relu_tiles(PlanBuilder& builder, const Workload& workload,
                              std::span<const Tensor> parameters, const Resident& in,
                              const Resident& out) {
  const dnn::ConvShape& s = operation_as<dnn::Conv2dRelu>(workload).shape;
  const ConvTile tile(builder.session());
  const auto weights = interleave_channels(parameters[0].as<float>(), s.out_c, ConvTile::kChannels);
  const auto bias = interleave_channels(parameters[1].as<float>(), s.out_c, ConvTile::kChannels);
  const auto offsets = term_offsets(s, in);
  const auto items = static_cast<std::int64_t>(builder.session().local_x);
  builder.step(kTiles, "conv2d_relu_tile",
               {items * blocks(s.out_h() * s.out_w(), tile.pixels),
                std::int64_t{workload.batch} * blocks(s.out_c, ConvTile::kChannels)},
               in, builder.constant(std::as_bytes(std::span(weights))),
               builder.constant(std::as_bytes(std::span(bias))), out,
               builder.constant(std::as_bytes(std::span(offsets))),
               static_cast<std::int32_t>(offsets.size()), in.pitch(), s.stride, s.out_c, s.out_h(),
               s.out_w(), out.plane(), out.pitch(), out.offset(), s.in_c * in.plane(),
               s.out_c * out.plane(), tile.pixel_memory, tile.weight_memory);
}

int conv2d_relu_pad(const Workload& workload) {
  return operation_as<dnn::Conv2dRelu>(workload).shape.pad;
}

void append_conv2d_relu(PlanBuilder& builder, const Workload& workload,
                        std::span<const Tensor> parameters, std::span<const Resident> inputs,
                        std::span<const Resident> outputs) {
  if (!builder.session().is_cpu && ConvTile::fits(builder.session())) {
    append_conv2d_relu_tiles(builder, workload, parameters, inputs[0], outputs[0]);
    return;
  }
  const dnn::ConvShape& s = operation_as<dnn::Conv2dRelu>(workload).shape;
  const int channels = builder.session().tuning[Parameter::kConvChannels];
  const int pixels = builder.session().tuning[Parameter::kConvPixels];
  const auto weights = interleave_channels(parameters[0].as<float>(), s.out_c, channels);
  const auto bias = interleave_channels(parameters[1].as<float>(), s.out_c, channels);
  const Resident& in = inputs[0];
  const Resident& out = outputs[0];
  builder.step(kSource, "conv2d_relu",
               {blocks(s.out_h() * s.out_w(), pixels),
                std::int64_t{workload.batch} * blocks(s.out_c, channels)},
               in, builder.constant(std::as_bytes(std::span(weights))),
               builder.constant(std::as_bytes(std::span(bias))), out, s.in_c, in.plane(),
               in.pitch(), s.k_h, s.k_w, s.stride, s.out_c, s.out_h(), s.out_w(), out.plane(),
               out.pitch(), out.offset(), s.in_c * in.plane(), s.out_c * out.plane());
}

void append_max_pool(PlanBuilder& builder, const Workload& workload, std::span<const Tensor>,
                     std::span<const Resident> inputs, std::span<const Resident> outputs) {
  const auto& op = operation_as<dnn::MaxPool>(workload);
  const Resident& out = outputs[0];
  builder.step(kSource, "max_pool",
               {op.out_w(), std::int64_t{workload.batch} * op.channels * op.out_h()}, inputs[0],
               out, op.in_h, op.in_w, op.size, op.stride, op.out_h(), op.out_w(), out.plane(),
               out.pitch(), out.offset());
}

void append_fully_connected(PlanBuilder& builder, const Workload& workload,
                            std::span<const Tensor> parameters, std::span<const Resident> inputs,
                            std::span<const Resident> outputs) {
  const auto& op = operation_as<dnn::FullyConnected>(workload);
  if (workload.batch > 1) {
    append_fully_connected_batch(builder, workload, parameters, inputs[0], outputs[0]);
    return;
  }
  const int rows = builder.session().tuning[Parameter::kFcRows];
  const auto weights = builder.constant(parameters[0].bytes());
  const auto bias = builder.constant(parameters[1].bytes());
  const bool is_cpu = builder.session().is_cpu;
  if (!is_cpu) {
    const std::size_t items = builder.session().local_x;
    const LocalMemory partial{sizeof(float) * static_cast<std::size_t>(rows) * items};
    builder.step(kTiles, "fully_connected_group",
                 {static_cast<std::int64_t>(items) * blocks(op.out, rows), 1}, inputs[0], weights,
                 bias, outputs[0], op.in, op.out, partial);
  } else {
    builder.step(kSource, "fully_connected", {blocks(op.out, rows), 1}, inputs[0], weights, bias,
                 outputs[0], op.in, op.out);
  }
  if (op.activation == dnn::Activation::kSoftmax) {
    // One work group: the extent is rounded up to it.
    builder.step(kSource, is_cpu ? "softmax_alone" : "softmax", {1, 1}, outputs[0], op.out);
  }
}

int first_input_pad(const Workload& layer) {
  const KernelEntry& entry = find_kernel(layer.kernel);
  return entry.input_pad != nullptr ? entry.input_pad(layer) : 0;
}

int sequence_pad(const Workload& workload) {
  return first_input_pad(operation_as<dnn::Sequence>(workload).layers.front());
}

void append_sequence(PlanBuilder& builder, const Workload& workload,
                     std::span<const Tensor> parameters, std::span<const Resident> inputs,
                     std::span<const Resident> outputs) {
  const auto& layers = operation_as<dnn::Sequence>(workload).layers;
  Resident previous = inputs[0];
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const Workload& layer = layers[i];
    // Each layer writes straight into the border that the next one wants.
    const bool last = i + 1 == layers.size();
    const Resident next =
        last ? outputs[0] : builder.resident(layer.outputs[0], first_input_pad(layers[i + 1]));
    find_kernel(layer.kernel)
        .append(builder, layer, parameters.first(layer.parameters.size()), std::span(&previous, 1),
                std::span(&next, 1));
    parameters = parameters.subspan(layer.parameters.size());
    previous = next;
    if (!last)
      previous.spec = layers[i + 1].inputs[0];  // Flattened where the next is fully connected.
  }
}

constexpr std::array kKernels = {
    KernelEntry{
        .kernel = "conv2d_relu", .append = append_conv2d_relu, .input_pad = conv2d_relu_pad},
    KernelEntry{.kernel = "max_pool", .append = append_max_pool},
    KernelEntry{.kernel = "fully_connected", .append = append_fully_connected},
    KernelEntry{.kernel = "sequence", .append = append_sequence, .input_pad = sequence_pad},
};

}  // namespace

std::span<const KernelEntry> dnn_kernels() { return kKernels; }

}  // namespace pirt::opencl
