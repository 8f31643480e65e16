// The gradients of a picture: workload sobel, and the first step of corners.
#pragma once

#include "workloads/backends/opencl/plan/plan.h"
#include "workloads/vision/vision.h"

namespace pirt::opencl {

/// Appends the launch that computes them as make_sobel defines.
/// @param source  The .cl file with kernel `sobel` that the caller's other steps are of too.
/// @param gx, gy  i16 [height,width].
void append_gradients(PlanBuilder& builder, std::string_view source,
                      const vision::ImageOperation& operation, const DeviceTensor& image,
                      const cl::Buffer& gx, const cl::Buffer& gy);

}  // namespace pirt::opencl
