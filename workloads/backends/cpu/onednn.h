// oneDNN, of its major versions 2 and 3: what the two say differently is said here, once.
//
// Version 3 has no operation descriptors, makes scales of each argument an attribute whose values
// are given with the call, and keeps the layout of a memory to itself.
#pragma once

#include <algorithm>
#include <oneapi/dnnl/dnnl.hpp>
#include <unordered_map>
#include <utility>
#include <vector>

#if DNNL_VERSION_MAJOR != 2 && DNNL_VERSION_MAJOR != 3
#error "pirt knows oneDNN 2 and 3; for another, see workloads/backends/cpu/onednn.h"
#endif

namespace pirt::cpu {

inline constexpr auto kInference = dnnl::prop_kind::forward_inference;

/// The description of a forward primitive. @param arguments  What follows the kind of propagation:
/// algorithm, descriptors of memory, strides.
template <typename Primitive, typename... Arguments>
[[nodiscard]] auto describe_forward(const dnnl::engine& engine,
                                    const dnnl::primitive_attr& attributes,
                                    Arguments&&... arguments) {
  using Description = typename Primitive::primitive_desc;
#if DNNL_VERSION_MAJOR == 2
  const typename Primitive::desc operation(kInference, std::forward<Arguments>(arguments)...);
  return Description(operation, attributes, engine);
#else
  return Description(engine, kInference, std::forward<Arguments>(arguments)..., attributes);
#endif
}

[[nodiscard]] inline dnnl::matmul::primitive_desc describe_matmul(const dnnl::engine& engine,
                                                                  const dnnl::memory::desc& a,
                                                                  const dnnl::memory::desc& b,
                                                                  const dnnl::memory::desc& c) {
#if DNNL_VERSION_MAJOR == 2
  return {{a, b, c}, engine};
#else
  return {engine, a, b, c};
#endif
}

[[nodiscard]] inline dnnl::eltwise_forward::primitive_desc describe_relu(
    const dnnl::engine& engine, const dnnl::memory::desc& values) {
#if DNNL_VERSION_MAJOR == 2
  return {{kInference, dnnl::algorithm::eltwise_relu, values, 0.0F}, engine};
#else
  return {engine, kInference, dnnl::algorithm::eltwise_relu, values, values, 0.0F};
#endif
}

[[nodiscard]] inline dnnl::softmax_forward::primitive_desc describe_softmax(
    const dnnl::engine& engine, const dnnl::memory::desc& values, int axis) {
#if DNNL_VERSION_MAJOR == 2
  return {{kInference, values, axis}, engine};
#else
  return {engine, kInference, dnnl::algorithm::softmax_accurate, values, values, axis};
#endif
}

/// Windows of @p size, @p stride apart, without padding.
[[nodiscard]] inline dnnl::pooling_forward::primitive_desc describe_max_pool(
    const dnnl::engine& engine, const dnnl::memory::desc& source, const dnnl::memory::desc& result,
    const dnnl::memory::dims& stride, const dnnl::memory::dims& size) {
  const dnnl::memory::dims none(size.size(), 0);
#if DNNL_VERSION_MAJOR == 2
  return {{kInference, dnnl::algorithm::pooling_max, source, result, stride, size, none, none},
          engine};
#else
  return {engine, kInference, dnnl::algorithm::pooling_max, source, result,
          stride, size,       none /* dilation */,          none,   none};
#endif
}

/// What is done behind sums of products: each output channel times a scale, where they are @p
/// quantized, and a ReLU. Version 2 wants the scales, @p scales, now; version 3 with the call.
[[nodiscard]] inline dnnl::primitive_attr attributes_after(bool quantized,
                                                           const std::vector<float>& scales,
                                                           bool relu) {
  dnnl::primitive_attr attributes;
#if DNNL_VERSION_MAJOR == 2
  if (quantized) attributes.set_output_scales(1 << 1, scales);
#else
  static_cast<void>(scales);
  if (quantized) attributes.set_scales_mask(DNNL_ARG_WEIGHTS, 1 << 0);
#endif
  if (!relu) return attributes;
  dnnl::post_ops after;
#if DNNL_VERSION_MAJOR == 2
  after.append_eltwise(1.0F, dnnl::algorithm::eltwise_relu, 0.0F, 0.0F);
#else
  after.append_eltwise(dnnl::algorithm::eltwise_relu, 0.0F, 0.0F);
#endif
  attributes.set_post_ops(after);
  return attributes;
}

/// Whether the bias is added before the sums are scaled, in their units.
inline constexpr bool kScalesBias = DNNL_VERSION_MAJOR == 2;

using Arguments = std::unordered_map<int, dnnl::memory>;

/// Adds @p scales to the arguments of a call, where it takes them.
inline void add_scales(Arguments& arguments, int of, const dnnl::engine& engine,
                       const std::vector<float>& scales) {
#if DNNL_VERSION_MAJOR == 2
  static_cast<void>(arguments), static_cast<void>(of), static_cast<void>(engine),
      static_cast<void>(scales);
#else
  using dnnl::memory;
  const memory values(
      {{static_cast<memory::dim>(scales.size())}, memory::data_type::f32, memory::format_tag::a},
      engine);
  std::ranges::copy(scales, static_cast<float*>(values.get_data_handle()));
  arguments.insert_or_assign(DNNL_ARG_ATTR_SCALES | of, values);
#endif
}

/// Values in another layout or type, times @p scale.
struct Reorder {
  Reorder(const dnnl::engine& engine, const dnnl::memory& from, const dnnl::memory& to,
          float scale = 1)
      : arguments{{DNNL_ARG_FROM, from}, {DNNL_ARG_TO, to}} {
    dnnl::primitive_attr attributes;
    if (scale != 1) {
#if DNNL_VERSION_MAJOR == 2
      attributes.set_output_scales(0, {scale});
#else
      attributes.set_scales_mask(DNNL_ARG_FROM, 0);
#endif
      add_scales(arguments, DNNL_ARG_FROM, engine, {scale});
    }
    primitive = dnnl::reorder(from, to, attributes);
  }

  dnnl::reorder primitive;
  Arguments arguments;
};

[[nodiscard]] inline dnnl::memory::dims dims_of(const dnnl::memory::desc& desc) {
#if DNNL_VERSION_MAJOR == 2
  return desc.dims();
#else
  return desc.get_dims();
#endif
}

/// Strides of the blocks, one a dimension.
[[nodiscard]] inline dnnl::memory::dims strides_of(const dnnl::memory::desc& desc) {
#if DNNL_VERSION_MAJOR == 2
  const auto& strides = desc.data.format_desc.blocking.strides;
  return {strides, strides + desc.data.ndims};
#else
  return desc.get_strides();
#endif
}

/// How blocks are made: the size of each level and the dimension that it divides.
[[nodiscard]] inline std::pair<dnnl::memory::dims, dnnl::memory::dims> blocks_of(
    const dnnl::memory::desc& desc) {
#if DNNL_VERSION_MAJOR == 2
  const auto& b = desc.data.format_desc.blocking;
  return {{b.inner_blks, b.inner_blks + b.inner_nblks},
          {b.inner_idxs, b.inner_idxs + b.inner_nblks}};
#else
  return {desc.get_inner_blks(), desc.get_inner_idxs()};
#endif
}

/// Whether the CPU sums products of 8 bits without rounding pairs of them to 16: unsigned 255 times
/// signed 127, twice, is more than these hold.
[[nodiscard]] inline bool has_wide_dot_products() {
  using dnnl::cpu_isa;
  switch (dnnl::get_effective_cpu_isa()) {
#if DNNL_VERSION_MAJOR == 2
    case cpu_isa::all:
    case cpu_isa::avx512_mic:
    case cpu_isa::avx512_mic_4ops:
#else
    case cpu_isa::isa_default:
#endif
    case cpu_isa::sse41:
    case cpu_isa::avx:
    case cpu_isa::avx2:
    case cpu_isa::avx512_core:
      return false;
    default:
      return true;
  }
}

}  // namespace pirt::cpu
