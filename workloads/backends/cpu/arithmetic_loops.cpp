// Multiply-adds and 8-bit dot products that stay in registers.
//
// A core needs (latency x instructions a cycle) independent chains to be busy, 8 to 10 on today's;
// more run out of registers. Loops with several counts are tried.
#include <array>

#include "workloads/backends/cpu/peak_loops.h"
#include "workloads/base/math/peak_math.h"
#include "workloads/base/system/processor.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace pirt::cpu {
namespace {

using peak_math::kAddend;
using peak_math::kFactor;

/// The compiler's own vectors: 128 bits, which every 64-bit processor has, fused where its
/// multiply-add is.
template <int kChains>
[[gnu::noinline]] void portable_chains(float* values, std::int64_t iterations) {
  using Vector [[gnu::vector_size(16), gnu::may_alias]] = float;
  auto* const vectors = reinterpret_cast<Vector*>(values);
  Vector x[kChains];
  for (int i = 0; i < kChains; ++i) x[i] = vectors[i];
  for (std::int64_t n = 0; n < iterations; ++n) {
#pragma GCC unroll 32
    for (int i = 0; i < kChains; ++i) x[i] = x[i] * kFactor + kAddend;
  }
  for (int i = 0; i < kChains; ++i) vectors[i] = x[i];
}

#if defined(__x86_64__)

bool has_avx512() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw");
}
bool has_avx512_vnni() { return has_avx512() && __builtin_cpu_supports("avx512vnni"); }

template <int kChains>
[[gnu::noinline, gnu::target("avx2,fma")]] void avx2_chains(float* values,
                                                            std::int64_t iterations) {
  __m256 x[kChains];
  const __m256 a = _mm256_set1_ps(kFactor);
  const __m256 b = _mm256_set1_ps(kAddend);
  for (int i = 0; i < kChains; ++i) x[i] = _mm256_load_ps(values + std::ptrdiff_t{8} * i);
  for (std::int64_t n = 0; n < iterations; ++n) {
#pragma GCC unroll 32
    for (int i = 0; i < kChains; ++i) x[i] = _mm256_fmadd_ps(x[i], a, b);
  }
  for (int i = 0; i < kChains; ++i) _mm256_store_ps(values + std::ptrdiff_t{8} * i, x[i]);
}

template <int kChains>
[[gnu::noinline, gnu::target("avx512f")]] void avx512_chains(float* values,
                                                             std::int64_t iterations) {
  __m512 x[kChains];
  const __m512 a = _mm512_set1_ps(kFactor);
  const __m512 b = _mm512_set1_ps(kAddend);
  for (int i = 0; i < kChains; ++i) x[i] = _mm512_load_ps(values + std::ptrdiff_t{16} * i);
  for (std::int64_t n = 0; n < iterations; ++n) {
#pragma GCC unroll 32
    for (int i = 0; i < kChains; ++i) x[i] = _mm512_fmadd_ps(x[i], a, b);
  }
  for (int i = 0; i < kChains; ++i) _mm512_store_ps(values + std::ptrdiff_t{16} * i, x[i]);
}

/// Without a dot product instruction: pairs of products to 16 bits (no saturation with data below
/// 128 and weights from -64 on), pairs of those to 32.
template <int kWeights>
[[gnu::noinline, gnu::target("avx2")]] void avx2_dots(const std::uint8_t* data,
                                                      const std::int8_t* weights,
                                                      std::int32_t* sums, std::int64_t iterations) {
  const auto* rows = reinterpret_cast<const __m256i*>(data);
  const auto* from = reinterpret_cast<const __m256i*>(weights);
  auto* to = reinterpret_cast<__m256i*>(sums);
  const __m256i ones = _mm256_set1_epi16(1);
  __m256i s[kWeights];
  for (int w = 0; w < kWeights; ++w) s[w] = _mm256_load_si256(to + w);
  for (std::int64_t n = 0; n < iterations; ++n) {
    const __m256i row = _mm256_load_si256(rows + n % DotLoop::kRows);
#pragma GCC unroll 32
    for (int w = 0; w < kWeights; ++w) {
      const __m256i pairs = _mm256_maddubs_epi16(row, _mm256_load_si256(from + w));
      s[w] = _mm256_add_epi32(s[w], _mm256_madd_epi16(pairs, ones));
    }
  }
  for (int w = 0; w < kWeights; ++w) _mm256_store_si256(to + w, s[w]);
}

/// Two rows at a time: sums of four such products still fit 16 bits, so that half of the widening
/// is saved.
template <int kWeights>
[[gnu::noinline, gnu::target("avx2")]] void avx2_paired_dots(const std::uint8_t* data,
                                                             const std::int8_t* weights,
                                                             std::int32_t* sums,
                                                             std::int64_t iterations) {
  static_assert(DotLoop::kRows % 2 == 0);
  const auto* rows = reinterpret_cast<const __m256i*>(data);
  const auto* from = reinterpret_cast<const __m256i*>(weights);
  auto* to = reinterpret_cast<__m256i*>(sums);
  const __m256i ones = _mm256_set1_epi16(1);
  __m256i s[kWeights];
  for (int w = 0; w < kWeights; ++w) s[w] = _mm256_load_si256(to + w);
  for (std::int64_t n = 0; n < iterations; n += 2) {
    const __m256i first = _mm256_load_si256(rows + n % DotLoop::kRows);
    const __m256i second = _mm256_load_si256(rows + n % DotLoop::kRows + 1);
#pragma GCC unroll 32
    for (int w = 0; w < kWeights; ++w) {
      const __m256i weight = _mm256_load_si256(from + w);
      const __m256i pairs = _mm256_add_epi16(_mm256_maddubs_epi16(first, weight),
                                             _mm256_maddubs_epi16(second, weight));
      s[w] = _mm256_add_epi32(s[w], _mm256_madd_epi16(pairs, ones));
    }
  }
  for (int w = 0; w < kWeights; ++w) _mm256_store_si256(to + w, s[w]);
}

template <int kWeights>
[[gnu::noinline, gnu::target("avx512f,avx512bw")]] void avx512_dots(const std::uint8_t* data,
                                                                    const std::int8_t* weights,
                                                                    std::int32_t* sums,
                                                                    std::int64_t iterations) {
  const __m512i ones = _mm512_set1_epi16(1);
  __m512i s[kWeights];
  for (int w = 0; w < kWeights; ++w) s[w] = _mm512_load_si512(sums + std::ptrdiff_t{16} * w);
  for (std::int64_t n = 0; n < iterations; ++n) {
    const __m512i row = _mm512_load_si512(data + 64 * (n % DotLoop::kRows));
#pragma GCC unroll 32
    for (int w = 0; w < kWeights; ++w) {
      const __m512i pairs =
          _mm512_maddubs_epi16(row, _mm512_load_si512(weights + std::ptrdiff_t{64} * w));
      s[w] = _mm512_add_epi32(s[w], _mm512_madd_epi16(pairs, ones));
    }
  }
  for (int w = 0; w < kWeights; ++w) _mm512_store_si512(sums + std::ptrdiff_t{16} * w, s[w]);
}

template <int kWeights>
[[gnu::noinline, gnu::target("avx512f,avx512vnni")]] void avx512_vnni_dots(
    const std::uint8_t* data, const std::int8_t* weights, std::int32_t* sums,
    std::int64_t iterations) {
  __m512i s[kWeights];
  for (int w = 0; w < kWeights; ++w) s[w] = _mm512_load_si512(sums + std::ptrdiff_t{16} * w);
  for (std::int64_t n = 0; n < iterations; ++n) {
    const __m512i row = _mm512_load_si512(data + 64 * (n % DotLoop::kRows));
#pragma GCC unroll 32
    for (int w = 0; w < kWeights; ++w) {
      s[w] = _mm512_dpbusd_epi32(s[w], row, _mm512_load_si512(weights + std::ptrdiff_t{64} * w));
    }
  }
  for (int w = 0; w < kWeights; ++w) _mm512_store_si512(sums + std::ptrdiff_t{16} * w, s[w]);
}

constexpr std::array kChainLoops = {
    ChainLoop{"128-bit vectors, 8 chains", always, 4 * 8, portable_chains<8>},
    ChainLoop{"128-bit vectors, 12 chains", always, 4 * 12, portable_chains<12>},
    ChainLoop{"AVX2 FMA, 8 chains", has_avx2_and_fma, 8 * 8, avx2_chains<8>},
    ChainLoop{"AVX2 FMA, 10 chains", has_avx2_and_fma, 8 * 10, avx2_chains<10>},
    ChainLoop{"AVX2 FMA, 12 chains", has_avx2_and_fma, 8 * 12, avx2_chains<12>},
    ChainLoop{"AVX-512 FMA, 8 chains", has_avx512, 16 * 8, avx512_chains<8>},
    ChainLoop{"AVX-512 FMA, 12 chains", has_avx512, 16 * 12, avx512_chains<12>},
    ChainLoop{"AVX-512 FMA, 20 chains", has_avx512, 16 * 20, avx512_chains<20>}};

constexpr std::array kDotLoops = {
    DotLoop{"AVX2 maddubs, 4 weights", has_avx2_and_fma, 8, 4, avx2_dots<4>},
    DotLoop{"AVX2 maddubs, 6 weights", has_avx2_and_fma, 8, 6, avx2_dots<6>},
    DotLoop{"AVX2 maddubs, 10 weights", has_avx2_and_fma, 8, 10, avx2_dots<10>},
    DotLoop{"AVX2 maddubs, 4 weights, two rows", has_avx2_and_fma, 8, 4, avx2_paired_dots<4>},
    DotLoop{"AVX2 maddubs, 8 weights, two rows", has_avx2_and_fma, 8, 8, avx2_paired_dots<8>},
    DotLoop{"AVX-512 maddubs, 8 weights", has_avx512, 16, 8, avx512_dots<8>},
    DotLoop{"AVX-512 VNNI, 8 weights", has_avx512_vnni, 16, 8, avx512_vnni_dots<8>},
    DotLoop{"AVX-512 VNNI, 12 weights", has_avx512_vnni, 16, 12, avx512_vnni_dots<12>}};

#else  // the portable vectors, with more registers than x86 has

constexpr std::array kChainLoops = {
    ChainLoop{"128-bit vectors, 8 chains", always, 4 * 8, portable_chains<8>},
    ChainLoop{"128-bit vectors, 12 chains", always, 4 * 12, portable_chains<12>},
    ChainLoop{"128-bit vectors, 16 chains", always, 4 * 16, portable_chains<16>},
    ChainLoop{"128-bit vectors, 24 chains", always, 4 * 24, portable_chains<24>}};

constexpr std::array<DotLoop, 0> kDotLoops = {};

#endif

}  // namespace

std::span<const ChainLoop> chain_loops() { return kChainLoops; }
std::span<const DotLoop> dot_loops() { return kDotLoops; }

}  // namespace pirt::cpu
