// AlexNet's layers and the chain of them, and the networks of recognition: weights, arguments and
// extents of the kernels in dnn.cl and, where the device has local memory of its own, tiles.cl.
#include <algorithm>
#include <array>
#include <vector>

#include "workloads/backends/opencl/kernels/batch_kernels.h"
#include "workloads/backends/opencl/kernels/convolution.h"
#include "workloads/backends/opencl/kernels/packing.h"
#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/dnn/dnn.h"

namespace pirt::opencl {
namespace {

constexpr std::string_view kSource = "dnn.cl";
constexpr std::string_view kTileSource = "tiles.cl";

int conv2d_relu_pad(const Workload& workload) {
  return operation_as<dnn::Conv2dRelu>(workload).shape.pad;
}

void append_conv2d_relu(PlanBuilder& builder, const Workload& workload,
                        std::span<const Tensor> parameters, std::span<const DeviceTensor> inputs,
                        std::span<const DeviceTensor> outputs) {
  append_convolution(builder,
                     {.shape = operation_as<dnn::Conv2dRelu>(workload).shape,
                      .weights = parameters[0].as<float>(),
                      .bias = parameters[1].as<float>(),
                      .images = workload.batch},
                     inputs[0], outputs[0]);
}

void append_max_pool(PlanBuilder& builder, const Workload& workload, std::span<const Tensor>,
                     std::span<const DeviceTensor> inputs, std::span<const DeviceTensor> outputs) {
  const auto& op = operation_as<dnn::MaxPool>(workload);
  const DeviceTensor& out = outputs[0];
  builder.step(kSource, "max_pool",
               {op.out_w(), std::int64_t{workload.batch} * op.channels * op.out_h()}, inputs[0],
               out, op.in_h, op.in_w, op.size, op.stride, op.out_h(), op.out_w(), out.plane(),
               out.pitch(), out.offset());
}

void append_fully_connected(PlanBuilder& builder, const Workload& workload,
                            std::span<const Tensor> parameters,
                            std::span<const DeviceTensor> inputs,
                            std::span<const DeviceTensor> outputs) {
  const auto& op = operation_as<dnn::FullyConnected>(workload);
  if (workload.batch > 1) {
    append_fully_connected_batch(builder, workload, parameters, inputs[0], outputs[0]);
    return;
  }
  const int rows = builder.session().value(Parameter::kFcRows);
  const auto weights = builder.constant(parameters[0].bytes());
  const auto bias = builder.constant(parameters[1].bytes());
  if (builder.session().is_cpu) {
    builder.step(kSource, "fully_connected", {blocks(op.out, rows), 1}, inputs[0], weights, bias,
                 outputs[0], op.in, op.out);
  } else {
    const LocalNeed need{.per_item = sizeof(float) * static_cast<std::size_t>(rows)};
    const std::size_t items = builder.group_items(kTileSource, "fully_connected_group", need);
    builder.step(kTileSource, "fully_connected_group",
                 {.x = static_cast<std::int64_t>(items) * blocks(op.out, rows), .group = items},
                 inputs[0], weights, bias, outputs[0], op.in, op.out, need.of(items));
  }
  if (op.activation != dnn::Activation::kSoftmax) return;
  if (builder.session().is_cpu) {
    builder.step(kSource, "softmax_alone", {1, 1}, outputs[0], op.out);
  } else {
    append_softmax(builder, outputs[0], op.out, 1);
  }
}

int first_input_pad(const Workload& layer) {
  const OpenclKernelEntry& entry = find_kernel(layer.kernel);
  return entry.input_pad != nullptr ? entry.input_pad(layer) : 0;
}

int sequence_pad(const Workload& workload) {
  return first_input_pad(operation_as<dnn::Sequence>(workload).layers.front());
}

void append_sequence(PlanBuilder& builder, const Workload& workload,
                     std::span<const Tensor> parameters, std::span<const DeviceTensor> inputs,
                     std::span<const DeviceTensor> outputs) {
  const auto& layers = operation_as<dnn::Sequence>(workload).layers;
  DeviceTensor previous = inputs[0];
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const Workload& layer = layers[i];
    // Each layer writes straight into the border that the next one wants.
    const bool last = i + 1 == layers.size();
    const DeviceTensor next =
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

constexpr std::array kDnnKernels = {
    OpenclKernelEntry{
        .kernel = "conv2d_relu", .append = append_conv2d_relu, .input_pad = conv2d_relu_pad},
    OpenclKernelEntry{.kernel = "max_pool", .append = append_max_pool},
    OpenclKernelEntry{.kernel = "fully_connected", .append = append_fully_connected},
    OpenclKernelEntry{.kernel = "detect_objects", .make = make_detect_objects},
    OpenclKernelEntry{.kernel = "sequence", .append = append_sequence, .input_pad = sequence_pad},
};

}  // namespace

std::span<const OpenclKernelEntry> dnn_kernels() { return kDnnKernels; }

}  // namespace pirt::opencl
