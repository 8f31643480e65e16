// The element types and scales in which oneDNN computes a layer of each precision.
#pragma once

#include <string>
#include <vector>

#include "workloads/backends/cpu/onednn.h"
#include "workloads/dnn/dnn.h"

namespace pirt::cpu {

struct Arithmetic {
  dnnl::memory::data_type source = dnnl::memory::data_type::f32;
  dnnl::memory::data_type weights = dnnl::memory::data_type::f32;
  /// Of int8; else empty or 1. A value times its scale, rounded, is what is computed with.
  float source_scale = 1;
  std::vector<float> weight_scales = {};  ///< One an output channel.

  [[nodiscard]] bool quantized() const { return !weight_scales.empty(); }
  /// What turns the sums of each output channel back into f32.
  [[nodiscard]] std::vector<float> output_scales() const;
  /// The bias of each output channel in the units of its sums.
  [[nodiscard]] std::vector<float> scaled_bias(const Tensor& bias) const;
};

/// Symmetric scales: one of the inputs, from their calibrated range, and one an output channel, of
/// its largest weight. @param weights  f32 [outputs, ...].
[[nodiscard]] Arithmetic arithmetic_of(Precision precision, dnn::ValueRange input,
                                       const Tensor& weights);

/// The layer as oneDNN's best primitive. @param batch  Images a call.
/// @throws dnnl::error if it has none.
[[nodiscard]] dnnl::convolution_forward::primitive_desc describe(const dnn::Conv2dRelu& layer,
                                                                 int batch,
                                                                 const Arithmetic& arithmetic,
                                                                 const dnnl::engine& engine);
/// @param source  Dimensions of the input: batch first, then as many as it has.
[[nodiscard]] dnnl::inner_product_forward::primitive_desc describe(const dnn::FullyConnected& layer,
                                                                   const dnnl::memory::dims& source,
                                                                   const Arithmetic& arithmetic,
                                                                   const dnnl::engine& engine);

/// Why this machine has no fast primitive for a layer in its precision; empty if it has.
[[nodiscard]] std::string missing_precision(const Workload& layer);

}  // namespace pirt::cpu
