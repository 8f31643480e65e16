#include "workloads/backends/cpu/dnn_precision.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace pirt::cpu {
namespace {

using dnnl::memory;
using Type = memory::data_type;

memory::desc any(const memory::dims& dims, Type type) {
  return {dims, type, memory::format_tag::any};
}

/// Each output channel's largest weight becomes @p limit.
std::vector<float> channel_scales(const Tensor& weights, float limit) {
  const auto values = weights.as<float>();
  const auto channels = static_cast<std::size_t>(weights.dim(0));
  const std::size_t length = values.size() / channels;
  std::vector<float> scales;
  for (std::size_t c = 0; c < channels; ++c) {
    float peak = 0;
    for (const float value : values.subspan(c * length, length)) {
      peak = std::max(peak, std::abs(value));
    }
    scales.push_back(peak > 0 ? limit / peak : 1);
  }
  return scales;
}

dnnl::primitive_attr attributes_of(const Arithmetic& arithmetic, bool relu) {
  return attributes_after(arithmetic.quantized(), arithmetic.output_scales(), relu);
}

/// For looking what there is, before there are weights.
Arithmetic types_of(Precision precision, dnn::ValueRange input, std::size_t channels) {
  Arithmetic arithmetic;
  if (precision == Precision::kBf16) arithmetic.source = arithmetic.weights = Type::bf16;
  if (precision == Precision::kInt8) {
    arithmetic.source = input.low < 0 ? Type::s8 : Type::u8;
    arithmetic.weights = Type::s8;
    arithmetic.weight_scales.assign(channels, 1.0F);
  }
  return arithmetic;
}

/// Reference primitives are plain loops: there to be compared with, not to be computed with.
bool is_reference(std::string_view implementation) { return implementation.starts_with("ref"); }

std::string implementation_of(const Workload& layer) {
  const dnnl::engine engine(dnnl::engine::kind::cpu, 0);
  if (const auto* conv = dynamic_cast<const dnn::Conv2dRelu*>(layer.operation.get())) {
    const auto channels = static_cast<std::size_t>(conv->shape.out_c);
    return describe(*conv, layer.batch, types_of(layer.precision, conv->input, channels), engine)
        .impl_info_str();
  }
  const auto& full = operation_as<dnn::FullyConnected>(layer);
  const auto channels = static_cast<std::size_t>(full.out);
  return describe(full, {layer.batch, full.in}, types_of(layer.precision, full.input, channels),
                  engine)
      .impl_info_str();
}

}  // namespace

std::vector<float> Arithmetic::output_scales() const {
  std::vector<float> scales;
  for (const float weight : weight_scales) scales.push_back(1.0F / (source_scale * weight));
  return scales;
}

std::vector<float> Arithmetic::scaled_bias(const Tensor& bias) const {
  const auto values = bias.as<float>();
  std::vector<float> scaled(values.begin(), values.end());
  for (std::size_t c = 0; c < weight_scales.size(); ++c) {
    scaled[c] *= source_scale * weight_scales[c];
  }
  return scaled;
}

Arithmetic arithmetic_of(Precision precision, dnn::ValueRange input, const Tensor& weights) {
  auto arithmetic = types_of(precision, input, static_cast<std::size_t>(weights.dim(0)));
  if (precision != Precision::kInt8) return arithmetic;
  const bool is_signed = arithmetic.source == Type::s8;
  arithmetic.source_scale =
      (is_signed ? 127.0F : 255.0F) / std::max(std::abs(input.low), std::abs(input.high));
  // For signed inputs oneDNN halves the weights itself where sums of pairs would not fit.
  const bool whole = is_signed || has_wide_dot_products();
  arithmetic.weight_scales = channel_scales(weights, whole ? 127.0F : 63.0F);
  return arithmetic;
}

dnnl::convolution_forward::primitive_desc describe(const dnn::Conv2dRelu& layer, int batch,
                                                   const Arithmetic& arithmetic,
                                                   const dnnl::engine& engine) {
  const dnn::ConvShape& s = layer.shape;
  const memory::dims pad = {s.pad, s.pad};
  return describe_forward<dnnl::convolution_forward>(
      engine, attributes_of(arithmetic, true), dnnl::algorithm::convolution_direct,
      any({batch, s.in_c, s.in_h, s.in_w}, arithmetic.source),
      any({s.out_c, s.in_c, s.k_h, s.k_w}, arithmetic.weights), any({s.out_c}, Type::f32),
      any({batch, s.out_c, s.out_h(), s.out_w()}, Type::f32), memory::dims{s.stride, s.stride}, pad,
      pad);
}

dnnl::inner_product_forward::primitive_desc describe(const dnn::FullyConnected& layer,
                                                     const memory::dims& source,
                                                     const Arithmetic& arithmetic,
                                                     const dnnl::engine& engine) {
  memory::dims weights = source;
  weights[0] = layer.out;
  return describe_forward<dnnl::inner_product_forward>(
      engine, attributes_of(arithmetic, false), any(source, arithmetic.source),
      any(weights, arithmetic.weights), any({layer.out}, Type::f32),
      any({source[0], layer.out}, Type::f32));
}

std::string missing_precision(const Workload& layer) {
  if (layer.precision == Precision::kF32) return "";
  std::string found;
  try {
    found = implementation_of(layer);
  } catch (const dnnl::error& error) {
    if (error.status != dnnl_unimplemented) throw;
  }
  if (!found.empty() && !is_reference(found)) return "";
  const auto* version = dnnl_version();
  return fmt::format("oneDNN {}.{}.{} has no {} primitive for '{}' that is fast on this CPU",
                     version->major, version->minor, version->patch, to_string(layer.precision),
                     layer.kernel);
}

}  // namespace pirt::cpu
