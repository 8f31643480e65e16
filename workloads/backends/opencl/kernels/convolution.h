// Convolutions of dnn.cl and product.cl, for layers and for networks of other families.
#pragma once

#include <span>

#include "workloads/backends/opencl/plan/plan.h"
#include "workloads/dnn/dnn.h"

namespace pirt::opencl {

struct Convolution {
  dnn::ConvShape shape;
  std::span<const float> weights;  ///< [out_c, in_c, k_h, k_w]
  std::span<const float> bias;     ///< [out_c]
  int images = 1;                  ///< Of a call.
  bool relu = true;                ///< max(0, sum) afterwards.
};

/// Appends the launches that compute it.
/// @param in   With the border that the shape pads. @param out  With whatever border.
void append_convolution(PlanBuilder& builder, const Convolution& convolution,
                        const DeviceTensor& in, const DeviceTensor& out);

}  // namespace pirt::opencl
