// Kernels for several images a call, most of them others than those for one (dnn_batch.cl).
#pragma once

#include <span>

#include "workloads/backends/opencl/plan/plan.h"
#include "workloads/model/workload.h"

namespace pirt::opencl {

/// A fully connected layer with its activation. @param parameters  Of the layer.
/// @param in   [batch, in]. @param out  [batch, out].
void append_fully_connected_batch(PlanBuilder& builder, const Workload& workload,
                                  std::span<const Tensor> parameters, const DeviceTensor& in,
                                  const DeviceTensor& out);

/// In place, of each of the images' @p count values.
void append_softmax(PlanBuilder& builder, const DeviceTensor& values, int count, int images);

}  // namespace pirt::opencl
