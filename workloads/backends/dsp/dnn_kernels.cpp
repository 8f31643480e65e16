// Layers in 8 bits. Weights are quantized in `prepare`, by the host, with a scale for each output
// channel; inputs by the DSP in each call, with the scale of their known range, and its sums become
// f32 there, too: that counts in `execute`.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "workloads/backends/dsp/kernels.h"
#include "workloads/dnn/dnn.h"

namespace pirt::dsp {
namespace {

constexpr int kLanes = PIRT_DSP_ALIGNMENT / 4;  ///< Output channels of a vector.
constexpr int kOffset = 128;                    ///< Added to weights; see program/int8.h.
constexpr int kSet = 3 * kLanes;                ///< Channels that a convolution computes at a time.

constexpr std::size_t size(int count) { return static_cast<std::size_t>(count); }
constexpr int round_up(int value, int unit) { return (value + unit - 1) / unit * unit; }

/// As struct Factor of program/int8.h.
struct Factor {
  std::int32_t mantissa, exponent;
};

Factor factor_of(double value) {
  int exponent = 0;
  const double mantissa = std::frexp(value, &exponent);
  return {static_cast<std::int32_t>(std::min(std::ldexp(mantissa, 31), 2147483647.0)), exponent};
}

/// One layer's parameters as the DSP has them: a scale for each output channel.
class Quantized {
 public:
  Quantized(std::span<const Tensor> parameters, double scale_of_inputs)
      : weights_(parameters[0].as<float>()),
        bias_(parameters[1].as<float>()),
        inputs_(scale_of_inputs),
        length_(weights_.size() / bias_.size()),
        scales_(dnn::int8_weight_scales(weights_, bias_.size())) {}

  /// 0 for a channel that there is not.
  [[nodiscard]] std::uint8_t weight(std::size_t channel, std::size_t at) const {
    if (channel >= bias_.size()) return kOffset;
    const double value = scales_[channel] * double{weights_[channel * length_ + at]};
    return static_cast<std::uint8_t>(kOffset + std::lrint(value));
  }

  /// Bias, mantissa and exponent of each of @p channels: ChannelScales of program/int8.h.
  [[nodiscard]] Buffer make_table(ProgramSession& session, int channels) const {
    const Buffer buffer = session.allocate(3 * size(channels) * 4, "the scales of a layer");
    std::vector<std::int32_t> table(3 * size(channels), 0);
    for (std::size_t c = 0; c < bias_.size(); ++c) {
      const double unit = inputs_ * scales_[c];
      const Factor factor = factor_of(1 / unit);
      // Sums stay below 2^28: what is more would be cut off all the same.
      table[c] = static_cast<std::int32_t>(std::clamp(double{bias_[c]} * unit, -0x1p28, 0x1p28));
      table[size(channels) + c] = factor.mantissa;
      table[2 * size(channels) + c] = factor.exponent;
    }
    std::memcpy(session.bytes(buffer).data(), table.data(), table.size() * 4);
    return buffer;
  }

 private:
  std::span<const float> weights_, bias_;
  double inputs_;
  std::size_t length_;  ///< Weights of a channel.
  std::vector<double> scales_;
};

std::string precision_fault(const Workload& workload) {
  if (workload.precision != Precision::kInt8) {
    return "backend dsp computes layers in int8 only: the DSP's vectors have no floating point";
  }
  return workload.batch > 1 ? "backend dsp computes one image a call" : "";
}

/// A bias below 2^28 and products of -128 by 127 are what a sum of 32 bits holds.
std::string sum_fault(std::int64_t products) {
  constexpr std::int64_t kMost = ((std::int64_t{1} << 31) - (1 << 28)) / (128 * 127);
  return products <= kMost
             ? ""
             : fmt::format("backend dsp sums at most {} products in its 32 bits", kMost);
}

std::string fully_connected_fault(const Workload& workload) {
  const std::string fault = precision_fault(workload);
  return fault.empty() ? sum_fault(operation_as<dnn::FullyConnected>(workload).in) : fault;
}

std::string convolution_fault(const Workload& workload) {
  const auto& s = operation_as<dnn::Conv2dRelu>(workload).shape;
  if (s.stride % 4 != 0 || s.pad != 0 || s.out_w() < 4 || s.out_h() * s.out_w() < kLanes) {
    return "backend dsp has a convolution for strides of 4 without padding only";
  }
  const std::string fault = precision_fault(workload);
  return fault.empty() ? sum_fault(std::int64_t{s.in_c} * s.k_h * s.k_w) : fault;
}

Call make_convolution(ProgramSession& session, const Workload& workload,
                      std::span<const Tensor> parameters) {
  const auto& op = operation_as<dnn::Conv2dRelu>(workload);
  const dnn::ConvShape& s = op.shape;
  const int pitch = round_up(s.in_w + 3, PIRT_DSP_ALIGNMENT);  // the last word's bytes are read
  const int words = round_up(s.k_w, 4) / 4;
  const int channels = round_up(s.out_c, kSet);
  const int rows = s.in_c * s.in_h;
  const double scale = dnn::int8_input_scale(op.input);
  const Quantized quantized(parameters, scale);

  const Buffer input = session.allocate(size(rows) * size(pitch) * 4, "the input of a layer");
  std::memset(session.bytes(input).data(), 0, input.bytes);
  const Buffer weights = session.allocate(
      size(channels) * size(s.in_c) * size(s.k_h) * size(words) * 4, "the weights of a layer");
  auto* to = session.bytes(weights).data();
  for (int set = 0; set < channels; set += kSet) {
    for (int row = 0; row < s.in_c * s.k_h; ++row) {
      for (int i = 0; i < words * kSet * 4; ++i) {
        const int x = i / (kSet * 4) * 4 + i % 4;
        const int channel = set + i / 4 % kSet;
        *to++ = std::byte{x < s.k_w ? quantized.weight(size(channel), size(row * s.k_w + x))
                                    : std::uint8_t{kOffset}};
      }
    }
  }

  Call call;
  call.kernel = PIRT_DSP_conv2d_relu;
  call.name = workload.name;
  call.inputs = {{input, size(rows), size(s.in_w) * 4, size(pitch) * 4}};
  call.outputs = {make_dense(session, workload.outputs[0])};
  call.buffers = {input,
                  call.outputs[0].buffer,
                  weights,
                  quantized.make_table(session, channels),
                  session.allocate(size(rows) * size(pitch), "the quantized input of a layer"),
                  session.allocate(size(s.out_h()) * size(s.out_w()) * size(channels) * 4,
                                   "the pixels of a layer"),
                  session.allocate(size(pitch), "the input sums of a layer")};
  call.loaded = {weights, call.buffers[3]};
  const Factor factor = factor_of(scale);
  call.values = {s.in_c, s.in_h, pitch,    s.out_c,      s.out_h(),       s.out_w(),
                 s.k_h,  words,  s.stride, s.stride / 4, factor.mantissa, factor.exponent};
  return call;
}

Call make_fully_connected(ProgramSession& session, const Workload& workload,
                          std::span<const Tensor> parameters) {
  const auto& op = operation_as<dnn::FullyConnected>(workload);
  const int in = round_up(op.in, PIRT_DSP_ALIGNMENT);
  const int channels = round_up(op.out, kLanes);
  const double scale = dnn::int8_input_scale(op.input);
  const Quantized quantized(parameters, scale);

  MappedTensor input{session.allocate(size(in) * 4, "the input of a layer"), 1, size(op.in) * 4,
                     size(op.in) * 4};
  std::memset(session.bytes(input.buffer).data(), 0, input.buffer.bytes);
  const Buffer weights = session.allocate(size(channels) * size(in), "the weights of a layer");
  auto* to = session.bytes(weights).data();
  for (int group = 0; group < channels; group += kLanes) {
    for (int i = 0; i < in * kLanes; ++i) {
      const int at = i / (kLanes * 4) * 4 + i % 4;
      const int channel = group + i / 4 % kLanes;
      *to++ =
          std::byte{at < op.in ? quantized.weight(size(channel), size(at)) : std::uint8_t{kOffset}};
    }
  }

  Call call;
  call.kernel = PIRT_DSP_fully_connected;
  call.name = workload.name;
  call.inputs = {input};
  const Buffer output = session.allocate(size(channels) * 4, "the output of a layer");
  call.outputs = {{output, 1, size(op.out) * 4, size(op.out) * 4}};
  call.buffers = {input.buffer, output, weights, quantized.make_table(session, channels),
                  session.allocate(size(in), "the quantized input of a layer")};
  call.loaded = {weights, call.buffers[3]};
  const Factor factor = factor_of(scale);
  call.values = {in, op.out, op.activation == dnn::Activation::kSoftmax ? 1 : 0, factor.mantissa,
                 factor.exponent};
  return call;
}

constexpr std::array kDnnKernels = {
    DspKernelEntry{"conv2d_relu", convolution_fault, make_convolution},
    DspKernelEntry{"fully_connected", fully_connected_fault, make_fully_connected},
};

}  // namespace

std::span<const DspKernelEntry> dnn_kernels() { return kDnnKernels; }

}  // namespace pirt::dsp
