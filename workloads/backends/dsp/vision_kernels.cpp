// The vision workloads: pictures in rows that begin at multiples of a vector.
#include <fmt/core.h>

#include <array>
#include <bit>

#include "workloads/backends/dsp/kernels.h"
#include "workloads/vision/vision.h"

namespace pirt::dsp {
namespace {

/// Kernels mirror a picture once at each edge, and load some rows ahead.
std::string too_small(const Workload& workload) {
  constexpr int kSmallest = 8;
  const auto& op = operation_as<vision::ImageOperation>(workload);
  if (op.width >= kSmallest && op.height >= kSmallest) return "";
  return fmt::format("backend dsp computes pictures of at least {0}x{0} pixels", kSmallest);
}

/// A call whose buffers are its inputs and outputs and whose values are width, height and pitch.
Call picture_call(ProgramSession& session, const Workload& workload, std::uint32_t kernel) {
  const auto& op = operation_as<vision::ImageOperation>(workload);
  Call call;
  call.kernel = kernel;
  call.name = workload.name;
  const auto place = [&](const TensorSpec& spec) {
    const bool picture =
        spec.shape.size() >= 2 && spec.shape[0] == op.height && spec.shape[1] == op.width;
    return picture ? make_picture(session, spec) : make_dense(session, spec);
  };
  for (const TensorSpec& spec : workload.inputs) {
    call.inputs.push_back(place(spec));
    call.buffers.push_back(call.inputs.back().buffer);
  }
  for (const TensorSpec& spec : workload.outputs) {
    call.outputs.push_back(place(spec));
    call.buffers.push_back(call.outputs.back().buffer);
  }
  call.values = {op.width, op.height, static_cast<std::int32_t>(call.inputs[0].pitch_bytes)};
  return call;
}

Call make_gaussian_blur(ProgramSession& session, const Workload& workload,
                        std::span<const Tensor>) {
  return picture_call(session, workload, PIRT_DSP_gaussian_blur);
}

Call make_sobel(ProgramSession& session, const Workload& workload, std::span<const Tensor>) {
  return picture_call(session, workload, PIRT_DSP_sobel);
}

Call make_filter7x7(ProgramSession& session, const Workload& workload,
                    std::span<const Tensor> parameters) {
  constexpr int kSize = vision::Filter7x7::kSize;
  static_assert(kSize == 7 && vision::Filter7x7::kShift == 8, "filter7x7.c has them as constants");
  Call call = picture_call(session, workload, PIRT_DSP_filter7x7);
  const auto& op = operation_as<vision::Filter7x7>(workload);
  const std::size_t bordered = (static_cast<std::size_t>(op.height) + kSize - 1) *
                               (call.inputs[0].pitch_bytes + std::size_t{2} * PIRT_DSP_ALIGNMENT);
  call.buffers.push_back(session.allocate(bordered, "the bordered picture of convolution"));
  const auto weights = parameters[0].as<std::int16_t>();
  for (std::size_t row = 0; row < kSize; ++row) {
    std::array<std::int8_t, 8> bytes{};
    for (std::size_t i = 0; i < kSize; ++i) {
      const std::int16_t weight = weights[row * kSize + i];
      if (weight < -128 || weight > 127) {
        throw_environment(fmt::format(
            "'{}' has a weight of {}, and backend dsp computes with 8 bits (-128 to 127)",
            workload.name, weight));
      }
      bytes[i] = static_cast<std::int8_t>(weight);
    }
    const auto words = std::bit_cast<std::array<std::int32_t, 2>>(bytes);
    call.values.insert(call.values.end(), words.begin(), words.end());
  }
  return call;
}

Call make_feature_detect(ProgramSession& session, const Workload& workload,
                         std::span<const Tensor>) {
  using vision::FeatureDetect;
  static_assert(FeatureDetect::kMaxCorners == 500 && FeatureDetect::kMinDistance == 10 &&
                    FeatureDetect::kQuality == 0.01 && FeatureDetect::kBlock == 3,
                "feature_detect.c has them as constants");
  const auto& op = operation_as<vision::FeatureDetect>(workload);
  Call call = picture_call(session, workload, PIRT_DSP_feature_detect);
  call.rows = make_dense(session, {"count", Element::kI32, {1}});
  call.buffers.push_back(call.rows->buffer);
  const std::size_t stride = call.inputs[0].pitch_bytes;
  const auto height = static_cast<std::size_t>(op.height);
  constexpr std::size_t kDistance = FeatureDetect::kMinDistance;
  const std::size_t sums = 3 * (stride + 64) * 4;
  const std::size_t occupied = (stride / 32 + 2) * (height + 2 * kDistance) * 4;
  const auto add = [&](std::size_t bytes, std::string_view what) {
    call.buffers.push_back(session.allocate(bytes, what));
  };
  add(height * stride * 2, "gx of feature_detect");
  add(height * stride * 2, "gy of feature_detect");
  add(height * stride * 4 + PIRT_DSP_ALIGNMENT, "the strengths of feature_detect");
  add(sums + occupied + PIRT_DSP_ALIGNMENT, "the scratch memory of feature_detect");
  add(height * static_cast<std::size_t>(op.width) * 8, "the candidates of feature_detect");
  return call;
}

Call make_optical_flow(ProgramSession& session, const Workload& workload, std::span<const Tensor>) {
  static_assert(vision::OpticalFlow::kWindow == 52, "optical_flow.c has it as a constant");
  const auto& op = operation_as<vision::OpticalFlow>(workload);
  Call call = picture_call(session, workload, PIRT_DSP_optical_flow);
  const std::size_t stride = call.inputs[0].pitch_bytes;
  const auto height = static_cast<std::size_t>(op.height);
  constexpr std::size_t kDerivativeBytes = 6;  // of a pixel: 3 of 2
  constexpr std::size_t kLines = 25;           // 5 products, of 4 phases and in total
  call.buffers.push_back(session.allocate((height + 1) * stride * kDerivativeBytes,
                                          "the derivatives of optical_flow"));
  call.buffers.push_back(
      session.allocate(kLines * (stride / 4 + 64) * 4, "the sums of optical_flow"));
  return call;
}

constexpr std::array kVisionKernels = {
    DspKernelEntry{"gaussian_blur", too_small, make_gaussian_blur},
    DspKernelEntry{"sobel", too_small, make_sobel},
    DspKernelEntry{"filter7x7", too_small, make_filter7x7},
    DspKernelEntry{"undistort", too_small, make_undistort},
    DspKernelEntry{"feature_detect", too_small, make_feature_detect},
    DspKernelEntry{"optical_flow", too_small, make_optical_flow},
};

}  // namespace

std::span<const DspKernelEntry> vision_kernels() { return kVisionKernels; }

}  // namespace pirt::dsp
