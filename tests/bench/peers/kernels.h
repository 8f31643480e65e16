// What tests/bench/kernels compares pirt's kernels with.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "workloads/model/workload.h"

namespace pirt::bench {

/// One call of a peer, input resident where it computes and complete on return.
using Call = std::function<void()>;

/// The vision workload as one would write it with OpenCV on cv::Mat; the input is the workload's.
[[nodiscard]] Call opencv_plain(const Workload& workload, const Data& data);

/// The same on cv::UMat: OpenCV's OpenCL path. Nothing if OpenCV finds no OpenCL device.
[[nodiscard]] std::optional<Call> opencv_opencl(const Workload& workload, const Data& data);
/// The device that it computes on.
[[nodiscard]] std::string opencv_opencl_device();

/// The convolution (without ReLU and bias) by CLBlast's im2col and GEMM on the OpenCL CPU device.
/// Nothing if CLBlast is not installed.
[[nodiscard]] std::optional<Call> clblast_convolution(const Workload& workload, const Data& data);

}  // namespace pirt::bench
