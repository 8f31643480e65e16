#include "workloads/backends/opencl/kernels/batch_kernels.h"

#include <limits>
#include <numeric>

#include "workloads/backends/opencl/kernels/packing.h"
#include "workloads/backends/opencl/kernels/product.h"
#include "workloads/dnn/dnn.h"

namespace pirt::opencl {
namespace {

/// As a product: a column is an image.
Product product_of(const dnn::FullyConnected& op, std::span<const Tensor> parameters, int images) {
  Product product{.weights = parameters[0].as<float>(),
                  .bias = parameters[1].as<float>(),
                  .channels = op.out,
                  .images = images,
                  .in_image = op.in,
                  .out_image = op.out,
                  .least = -std::numeric_limits<float>::infinity()};
  product.offsets.resize(static_cast<std::size_t>(op.in));
  std::iota(product.offsets.begin(), product.offsets.end(), 0);
  return product;
}

constexpr int kOutputsPerItem = 16;  // OUTPUTS of dnn_batch.cl.
constexpr int kImagesPerBlock = 6;   // IMAGES of dnn_batch.cl.

}  // namespace

void append_softmax(PlanBuilder& builder, const DeviceTensor& values, int count, int images) {
  constexpr LocalNeed kNeed{.per_item = sizeof(float)};
  const std::size_t items = builder.group_items("dnn.cl", "softmax", kNeed);
  // One work group an image: the extent is rounded up to it.
  builder.step("dnn.cl", "softmax", {.x = 1, .y = images, .group = items}, values, count,
               kNeed.of(items));
}

void append_fully_connected_batch(PlanBuilder& builder, const Workload& workload,
                                  std::span<const Tensor> parameters, const DeviceTensor& in,
                                  const DeviceTensor& out) {
  const auto& op = operation_as<dnn::FullyConnected>(workload);
  if (!append_product(builder, product_of(op, parameters, workload.batch), in, out)) {
    const auto weights = interleave_channels(parameters[0].as<float>(), op.out, kOutputsPerItem);
    const auto bias = interleave_channels(parameters[1].as<float>(), op.out, kOutputsPerItem);
    const int items = blocks(op.out, kOutputsPerItem);
    const int rows = blocks(workload.batch, kImagesPerBlock) * kImagesPerBlock;
    const auto sums = builder.scratch(std::int64_t{items} * rows * kOutputsPerItem *
                                      static_cast<std::int64_t>(sizeof(float)));
    builder.step("dnn_batch.cl", "fully_connected_batch", {items, 1}, in,
                 builder.constant(std::as_bytes(std::span(weights))),
                 builder.constant(std::as_bytes(std::span(bias))), sums, out, op.in, op.out,
                 workload.batch);
  }
  if (op.activation == dnn::Activation::kSoftmax) {
    append_softmax(builder, out, op.out, workload.batch);
  }
}

}  // namespace pirt::opencl
