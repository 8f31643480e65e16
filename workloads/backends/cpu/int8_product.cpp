// A fully connected layer on one image in int8. oneDNN takes its general matrix product there,
// which reads the weights at a fraction of the memory's rate; reading them is all that such a layer
// is.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "workloads/backends/cpu/dnn_precision.h"
#include "workloads/backends/cpu/kernels.h"
#include "workloads/base/system/processor.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace pirt::cpu {
namespace {

/// Of a row of weights; what is beyond the layer's inputs is 0.
constexpr std::int64_t kGrain = 32;

/// The sum of products of @p length values, a multiple of kGrain. Exact: 2^17 products of 8 bits
/// fit.
using Dot = std::int32_t (*)(const std::int16_t* values, const std::int8_t* weights,
                             std::int64_t length);

std::int32_t portable_dot(const std::int16_t* values, const std::int8_t* weights,
                          std::int64_t length) {
  std::int32_t sum = 0;
  for (std::int64_t i = 0; i < length; ++i) sum += values[i] * weights[i];
  return sum;
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] std::int32_t avx2_dot(const std::int16_t* values,
                                              const std::int8_t* weights, std::int64_t length) {
  __m256i sums[2] = {_mm256_setzero_si256(), _mm256_setzero_si256()};
  for (std::int64_t i = 0; i < length; i += kGrain) {
    for (int half = 0; half < 2; ++half) {
      const std::int64_t at = i + 16 * half;
      const auto bytes = _mm_load_si128(reinterpret_cast<const __m128i*>(weights + at));
      const auto x = _mm256_load_si256(reinterpret_cast<const __m256i*>(values + at));
      sums[half] = _mm256_add_epi32(sums[half], _mm256_madd_epi16(x, _mm256_cvtepi8_epi16(bytes)));
    }
  }
  const __m256i both = _mm256_add_epi32(sums[0], sums[1]);
  __m128i four = _mm_add_epi32(_mm256_castsi256_si128(both), _mm256_extracti128_si256(both, 1));
  four = _mm_add_epi32(four, _mm_shuffle_epi32(four, 0x4E));
  four = _mm_add_epi32(four, _mm_shuffle_epi32(four, 0xB1));
  return _mm_cvtsi128_si32(four);
}
#endif

Dot best_dot() {
#if defined(__x86_64__)
  if (has_avx2()) return avx2_dot;
#endif
  return portable_dot;
}

/// Times @p scale, rounded to even, within what the type holds.
std::int16_t quantized(float value, float scale, float least, float most) {
  return static_cast<std::int16_t>(std::clamp(std::nearbyint(value * scale), least, most));
}

class Int8Product final : public Kernel {
 public:
  Int8Product(const dnn::FullyConnected& layer, std::span<const Tensor> parameters,
              std::shared_ptr<BandTeam> team)
      : arithmetic_(arithmetic_of(Precision::kInt8, layer.input, parameters[0])),
        in_(layer.in),
        out_(layer.out),
        stride_((in_ + kGrain - 1) / kGrain * kGrain),
        scales_(arithmetic_.output_scales()),
        bias_(arithmetic_.scaled_bias(parameters[1])),
        weights_({.name = "weights", .element = Element::kU8, .shape = {out_, stride_}}),
        values_({.name = "values", .element = Element::kI16, .shape = {stride_}}),
        softmax_(layer.activation == dnn::Activation::kSoftmax),
        team_(std::move(team)) {
    const auto from = parameters[0].as<float>();
    std::ranges::fill(values_.as<std::int16_t>(), std::int16_t{0});
    auto* const to = reinterpret_cast<std::int8_t*>(weights_.as<std::uint8_t>().data());
    std::fill_n(to, out_ * stride_, std::int8_t{0});
    for (std::int64_t row = 0; row < out_; ++row) {
      const float scale = arithmetic_.weight_scales[static_cast<std::size_t>(row)];
      for (std::int64_t i = 0; i < in_; ++i) {
        const float weight = from[static_cast<std::size_t>(row * in_ + i)];
        to[row * stride_ + i] = static_cast<std::int8_t>(quantized(weight, scale, -127, 127));
      }
    }
  }

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    input_ = inputs[0].as<float>();
    output_ = outputs[0].as<float>();
  }

  std::optional<Nanos> execute(int repeats) override {
    for (int i = 0; i < repeats; ++i) compute();
    return std::nullopt;
  }

 private:
  void compute() {
    const bool is_signed = arithmetic_.source == dnnl::memory::data_type::s8;
    auto* const values = values_.as<std::int16_t>().data();
    for (std::size_t i = 0; i < input_.size(); ++i) {
      values[i] = quantized(input_[i], arithmetic_.source_scale, is_signed ? -128.0F : 0.0F,
                            is_signed ? 127.0F : 255.0F);
    }
    const auto* const weights =
        reinterpret_cast<const std::int8_t*>(weights_.as<std::uint8_t>().data());
    const int parts = team_->size();
    team_->run(parts, [&](int part) {
      for (std::int64_t row = out_ * part / parts; row < out_ * (part + 1) / parts; ++row) {
        const auto sum = static_cast<float>(dot_(values, weights + row * stride_, stride_));
        const auto at = static_cast<std::size_t>(row);
        output_[at] = (sum + bias_[at]) * scales_[at];
      }
    });
    if (softmax_) take_softmax();
  }

  /// In place; shifted by the largest, so that nothing overflows.
  void take_softmax() {
    const float largest = std::ranges::max(output_);
    float sum = 0;
    for (float& value : output_) sum += value = std::exp(value - largest);
    for (float& value : output_) value /= sum;
  }

  Arithmetic arithmetic_;
  std::int64_t in_, out_, stride_;
  std::vector<float> scales_, bias_;
  Tensor weights_, values_;
  bool softmax_;
  std::shared_ptr<BandTeam> team_;
  Dot dot_ = best_dot();
  std::span<const float> input_;
  std::span<float> output_;
};

}  // namespace

std::unique_ptr<Kernel> make_int8_product(const Workload& workload,
                                          std::span<const Tensor> parameters,
                                          const std::shared_ptr<BandTeam>& team) {
  return std::make_unique<Int8Product>(operation_as<dnn::FullyConnected>(workload), parameters,
                                       team);
}

}  // namespace pirt::cpu
