// The AlexNet layers of Table I (ungrouped, no local response normalization: the paper's operation
// counts say so), the pools between them and the whole chain. f32, channel-major, batch 1
// except for batched().
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "workloads/model/workload.h"

namespace pirt::dnn {

struct ConvShape {
  int in_c = 1, in_h = 1, in_w = 1;
  int out_c = 1, k_h = 1, k_w = 1;
  int stride = 1, pad = 0;
  [[nodiscard]] int out_h() const { return (in_h + 2 * pad - k_h) / stride + 1; }
  [[nodiscard]] int out_w() const { return (in_w + 2 * pad - k_w) / stride + 1; }
};

/// Arithmetic work of one dense (ungrouped) 2-D convolution; bias and ReLU excluded.
///
/// @param s  Input [in_c, in_h, in_w], filter [out_c, in_c, k_h, k_w]; all extents >= 1, in pixels.
/// @return   2 * out_c*out_h*out_w * in_c*k_h*k_w operations (a multiply-add counts 2).
/// @throws   Error{kBadInput} if the filter exceeds the padded input.
/// @source   Paper, Table I. Gives CONV2 = 895.8 M where the paper prints 895.5 M; the formula
/// stands.
[[nodiscard]] std::int64_t conv2d_ops(const ConvShape& s);

/// How many of conv2d_ops multiply zeros of the padding: all but those of the taps that lie within
/// the input.
[[nodiscard]] std::int64_t conv2d_padding_ops(const ConvShape& s);

/// Where a layer's inputs lie: what calibrating a quantized network on its data finds. Int8 kernels
/// map it to 8 bits and saturate what lies beyond.
struct ValueRange {
  float low = 0, high = 1;
};

/// What kernels of signed 8 bits multiply inputs of @p range by, so that the farthest from 0 is
/// 127.
[[nodiscard]] double int8_input_scale(ValueRange range);
/// The same of the weights of each of @p channels; 1 for one whose weights are all 0.
/// @param weights  One channel after the other, as many of each.
[[nodiscard]] std::vector<double> int8_weight_scales(std::span<const float> weights,
                                                     std::size_t channels);

/// Kernel "conv2d_relu": input f32 [in_c,in_h,in_w]; parameters weights f32 [out_c,in_c,k_h,k_w],
/// bias f32 [out_c]; output f32 [out_c,out_h,out_w] = max(0, conv + bias).
struct Conv2dRelu : Operation {
  ConvShape shape;
  ValueRange input = {};
};

/// Kernel "max_pool": input f32 [c,h,w], output f32 [c,out_h,out_w]; windows inside the input only
/// (floor).
struct MaxPool : Operation {
  int channels = 1, in_h = 1, in_w = 1;
  int size = 3, stride = 2;
  [[nodiscard]] int out_h() const { return (in_h - size) / stride + 1; }
  [[nodiscard]] int out_w() const { return (in_w - size) / stride + 1; }
};

enum class Activation : std::uint8_t {
  kDropout,  ///< Identity at inference. Table I names dropout and no ReLU for FC6 and FC7; that
             ///< reading is kept.
  kSoftmax,
};

/// Kernel "fully_connected": input f32 [in]; parameters weights f32 [out,in], bias f32 [out];
/// output f32 [out].
struct FullyConnected : Operation {
  int in = 1, out = 1;
  ValueRange input = {};
  Activation activation = Activation::kDropout;
};

/// Kernel "sequence": the layers one after the other, the output of one being the input of the next
/// (flattened where the next is fully connected). Parameters are those of the layers in order,
/// named "<layer>.weights" and "<layer>.bias".
struct Sequence : Operation {
  std::vector<Workload> layers;
};

/// Into how many parts, each of as many output channels, a layer of a chain is computed, so that
/// the chain can be left between them. One image a call and f32 only: others are 1.
[[nodiscard]] int parts_of(const Workload& layer, int batch);
/// The parts of a chain's layers in order, after each of which but the last a call can be left
/// (workloads/model/slices.h), as shares of its time; empty for other workloads. The time of a
/// layer is taken to be that of its operations, or of its bytes at 8 operations each, whichever is
/// longer: on one core of an AMD EPYC conv2 did 121 M operations in a ms, fc6 15.6 MB.
[[nodiscard]] std::vector<double> slices_of(const Workload& chain);

[[nodiscard]] Workload make_conv2d_relu(std::string name, const ConvShape& shape);
[[nodiscard]] Workload make_max_pool(std::string name, int channels, int in_h, int in_w, int size,
                                     int stride);
[[nodiscard]] Workload make_fully_connected(std::string name, int in, int out,
                                            Activation activation);
/// AlexNet's five convolutions with pool1, pool2, pool5 and the three fully connected layers: f32
/// [3,227,227] to 1000 probabilities.
[[nodiscard]] Workload make_alexnet();

/// The layer or chain @p plain for @p batch images a call: inputs and outputs with a leading
/// dimension of it, parameters unchanged. Image i is the one of seed + i; the reference is the
/// plain one of each image, and each image must verify by itself.
[[nodiscard]] Workload batched(const Workload& plain, int batch);

/// The convolution or fully connected layer @p plain with its products in @p precision, and with
/// the error bound that this needs; nothing for other workloads.
[[nodiscard]] std::optional<Workload> in_precision(const Workload& plain, Precision precision);

/// conv1..5, fc6..8 at the paper's sizes.
[[nodiscard]] std::vector<Workload> table1();
/// pool1, pool2, pool5.
[[nodiscard]] std::vector<Workload> pools();

}  // namespace pirt::dnn
