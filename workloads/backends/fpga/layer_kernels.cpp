// Layers in 8 bits on mac_array: weights are quantized in `prepare` with a scale for each output
// channel, inputs by the host in each call with the scale of their known range. The core gives the
// exact sums; what follows them (scales, bias, activation) is the host's, too.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>

#include "workloads/backends/fpga/kernels.h"
#include "workloads/dnn/dnn.h"

namespace pirt::fpga {
namespace {

constexpr int kSide = 14;  ///< Channels of a group, pixels of a tile, bytes of a word: mac_array.v.
constexpr int kElementsOut = kSide * kSide / 2;
constexpr int kInputWords = 1 << 14, kRingWords = 8000;
constexpr double kLimit = 127;

constexpr std::size_t size(std::int64_t count) { return static_cast<std::size_t>(count); }
constexpr int ceil_of(int value, int unit) { return (value + unit - 1) / unit; }

/// A layer as mac_array has it: a convolution of stride 1. A larger stride becomes channels: pixel
/// (y, x) of channel c lies in channel (c, y mod stride, x mod stride) at (y / stride, x / stride),
/// and so do the filter's.
struct Shape {
  int channels = 1, rows = 1, columns = 1;  ///< Of the inputs, without zeros around them.
  int filter = 1, pad = 0, stride = 1;
  int out_c = 1, out_h = 1, out_w = 1;

  [[nodiscard]] int tiles() const { return ceil_of(out_w, kSide); }
  [[nodiscard]] int groups() const { return ceil_of(out_c, kSide); }
  /// Of a row with the zeros left of it. Those right of it are the next row's, and behind the last
  /// row there is a word of zeros.
  [[nodiscard]] int row_words() const { return ceil_of(out_w + filter - 1 - pad, kSide); }
  [[nodiscard]] int plane_words() const { return rows * row_words(); }
  [[nodiscard]] int input_words() const { return channels * plane_words() + 1; }
  [[nodiscard]] int group_words() const { return channels * filter * filter; }
  [[nodiscard]] std::int64_t out_elements() const {
    return std::int64_t{groups()} * out_h * tiles() * kElementsOut;
  }
};

Shape shape_of(const dnn::ConvShape& s) {
  const int filter = ceil_of(std::max(s.k_h, s.k_w), s.stride);
  return {.channels = s.in_c * s.stride * s.stride,
          .rows = s.stride == 1 ? s.in_h : s.out_h() + filter - 1,
          .columns = s.stride == 1 ? s.in_w : s.out_w() + filter - 1,
          .filter = filter,
          .pad = s.pad,
          .stride = s.stride,
          .out_c = s.out_c,
          .out_h = s.out_h(),
          .out_w = s.out_w()};
}

Shape shape_of(const dnn::FullyConnected& op) { return {.channels = op.in, .out_c = op.out}; }

std::string precision_fault(const Workload& workload) {
  if (workload.precision != Precision::kInt8) {
    return "backend fpga computes layers in int8 only: its multipliers have 8 bits";
  }
  return workload.batch > 1 ? "backend fpga computes one image a call" : "";
}

std::string shape_fault(const Shape& s) {
  // Within the bits of the core's settings, too: 14 of input_words do not hold 2^14.
  const bool fits = s.input_words() < kInputWords && s.filter <= 7 && s.rows <= 127 &&
                    s.out_h <= 127 && s.tiles() <= 15 && s.pad < std::max(s.filter, 1) &&
                    s.row_words() <= 15 && s.groups() <= 1023 && s.plane_words() <= 1023 &&
                    s.group_words() < kInputWords &&
                    (s.group_words() <= kRingWords || s.tiles() * s.out_h == 1);
  return fits ? "" : "the layer does not fit into the on-chip memory of backend fpga's mac_array";
}

std::string convolution_fault(const FpgaKernelEntry&, const Workload& workload) {
  const auto& s = operation_as<dnn::Conv2dRelu>(workload).shape;
  if (s.stride > 1 && s.pad > 0) {
    return "backend fpga has convolutions with a stride without padding only";
  }
  const std::string fault = precision_fault(workload);
  return fault.empty() ? shape_fault(shape_of(s)) : fault;
}

std::string fully_connected_fault(const FpgaKernelEntry&, const Workload& workload) {
  const std::string fault = precision_fault(workload);
  return fault.empty() ? shape_fault(shape_of(operation_as<dnn::FullyConnected>(workload))) : fault;
}

/// What a layer needs beside its sums.
struct Layer {
  Shape shape;
  int in_h = 1, in_w = 1, in_c = 1, k_h = 1, k_w = 1;
  double input_scale = 1;
  std::vector<double> weight_scales;
  std::vector<float> bias;
  bool relu = false, softmax = false;
};

std::byte rounded(double value) {
  const auto whole = static_cast<std::int8_t>(std::lrint(std::clamp(value, -kLimit, kLimit)));
  return static_cast<std::byte>(whole);
}

/// Cycles of an in-order core for what it does to an element (load, scale, round or add, store) and
/// for an exponential: assumptions.
constexpr double kElement = 10, kExponential = 100;

double fill_inputs(const Layer& layer, std::span<const float> values, std::span<std::byte> words) {
  const Shape& s = layer.shape;
  std::ranges::fill(words.first(size(s.input_words()) * kSide), std::byte{0});
  std::size_t i = 0;
  for (int c = 0; c < layer.in_c; ++c) {
    for (int y = 0; y < layer.in_h; ++y) {
      for (int x = 0; x < layer.in_w; ++x, ++i) {
        const int channel = (c * s.stride + y % s.stride) * s.stride + x % s.stride;
        const int row = y / s.stride, column = x / s.stride + s.pad;
        if (row >= s.rows || column >= s.row_words() * kSide) continue;  // no output reads it
        const std::int64_t word = std::int64_t{channel} * s.plane_words() + row * s.row_words();
        words[size(word * kSide + column)] = rounded(layer.input_scale * double{values[i]});
      }
    }
  }
  return kElement * static_cast<double>(values.size());
}

double finish_outputs(const Layer& layer, std::span<const std::byte> lane, std::span<float> out) {
  const Shape& s = layer.shape;
  for (int c = 0; c < s.out_c; ++c) {
    const double scale = 1 / (layer.input_scale * layer.weight_scales[size(c)]);
    for (int y = 0; y < s.out_h; ++y) {
      for (int x = 0; x < s.out_w; ++x) {
        const std::int64_t tile = (std::int64_t{c / kSide} * s.out_h + y) * s.tiles() + x / kSide;
        const std::int64_t at = (tile * kSide + c % kSide) * kSide + x % kSide;
        std::int32_t sum = 0;
        std::memcpy(&sum, &lane[size(4 * at)], sizeof sum);
        const double value = scale * sum + double{layer.bias[size(c)]};
        const auto to = size((std::int64_t{c} * s.out_h + y) * s.out_w + x);
        out[to] = static_cast<float>(layer.relu ? std::max(value, 0.0) : value);
      }
    }
  }
  double cycles = kElement * static_cast<double>(out.size());
  if (layer.softmax) {
    const float peak = *std::ranges::max_element(out);
    double total = 0;
    for (float& value : out) total += value = std::exp(value - peak);
    for (float& value : out) value = static_cast<float>(value / total);
    cycles += kExponential * static_cast<double>(out.size());
  }
  return cycles;
}

/// Words of 14 channels, group after group; zeros for channels and taps that there are not.
void append_weights(Layer& layer, std::span<const float> weights, std::vector<std::byte>& to) {
  const Shape& s = layer.shape;
  layer.weight_scales = dnn::int8_weight_scales(weights, layer.bias.size());
  const auto weight = [&](int out, int channel, int ky, int kx) {
    const int c = channel / (s.stride * s.stride);
    const int y = ky * s.stride + channel / s.stride % s.stride,
              x = kx * s.stride + channel % s.stride;
    if (out >= s.out_c || y >= layer.k_h || x >= layer.k_w) return std::byte{0};
    const auto at = size(((std::int64_t{out} * layer.in_c + c) * layer.k_h + y) * layer.k_w + x);
    return rounded(layer.weight_scales[size(out)] * double{weights[at]});
  };
  for (int group = 0; group < s.groups(); ++group) {
    for (int channel = 0; channel < s.channels; ++channel) {
      for (int tap = 0; tap < s.filter * s.filter; ++tap) {
        for (int m = 0; m < kSide; ++m) {
          to.push_back(weight(group * kSide + m, channel, tap / s.filter, tap % s.filter));
        }
      }
    }
  }
}

Call call_of(Layer layer, std::span<const Tensor> parameters) {
  const Shape& s = layer.shape;
  Call call{.core = "mac_array"};
  for (const int value :
       {s.channels, s.filter, s.rows, s.row_words(), s.out_h, s.tiles(), s.groups(), s.pad,
        s.input_words(), s.group_words(), s.plane_words(), s.filter * s.filter}) {
    call.parameters.push_back(static_cast<std::uint8_t>(value & 0xff));
    call.parameters.push_back(static_cast<std::uint8_t>(value >> 8));
  }
  const auto bias = parameters[1].as<float>();
  layer.bias.assign(bias.begin(), bias.end());
  InLane lane{.bytes = kSide / 2, .memory = {}, .call_bytes = size(s.input_words()) * kSide};
  lane.memory.resize(lane.call_bytes);
  append_weights(layer, parameters[0].as<float>(), lane.memory);
  lane.loaded_bytes = lane.memory.size() - lane.call_bytes;
  call.in.push_back(std::move(lane));
  call.out = {{8, size(8 * s.out_elements())}};
  const auto shared = std::make_shared<const Layer>(std::move(layer));
  call.fill = [shared](std::span<const Tensor> inputs, std::vector<InLane>& lanes) {
    return fill_inputs(*shared, inputs[0].as<float>(), lanes[0].memory);
  };
  call.finish = [shared](std::span<const std::vector<std::byte>> lanes, std::span<Tensor> outputs) {
    return finish_outputs(*shared, lanes[0], outputs[0].as<float>());
  };
  return call;
}

Call make_conv_layer(const Workload& workload, std::span<const Tensor> parameters) {
  const auto& op = operation_as<dnn::Conv2dRelu>(workload);
  const dnn::ConvShape& s = op.shape;
  return call_of({.shape = shape_of(s),
                  .in_h = s.in_h,
                  .in_w = s.in_w,
                  .in_c = s.in_c,
                  .k_h = s.k_h,
                  .k_w = s.k_w,
                  .input_scale = dnn::int8_input_scale(op.input),
                  .weight_scales = {},
                  .bias = {},
                  .relu = true},
                 parameters);
}

Call make_fully_connected(const Workload& workload, std::span<const Tensor> parameters) {
  const auto& op = operation_as<dnn::FullyConnected>(workload);
  return call_of({.shape = shape_of(op),
                  .in_c = op.in,
                  .input_scale = dnn::int8_input_scale(op.input),
                  .weight_scales = {},
                  .bias = {},
                  .softmax = op.activation == dnn::Activation::kSoftmax},
                 parameters);
}

constexpr std::array kLayerKernels = {
    FpgaKernelEntry{"conv2d_relu", "mac_array", "layers", convolution_fault, make_conv_layer},
    FpgaKernelEntry{"fully_connected", "mac_array", "layers", fully_connected_fault,
                    make_fully_connected},
};

}  // namespace

std::span<const FpgaKernelEntry> layer_kernels() { return kLayerKernels; }

}  // namespace pirt::fpga
