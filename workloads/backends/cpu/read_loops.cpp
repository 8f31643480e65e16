// Reading as fast as a core can: sums of 32-bit words.
#include <array>
#include <cstring>

#include "workloads/backends/cpu/peak_loops.h"
#include "workloads/base/system/processor.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace pirt::cpu {
namespace {

using Vector [[gnu::vector_size(16), gnu::may_alias]] = std::uint32_t;

/// @p kStreams  Parts of the memory that are read in turn: hardware prefetchers follow several.
template <int kStreams>
[[gnu::noinline]] std::uint32_t portable_sum(const std::uint32_t* words, std::size_t size_bytes) {
  constexpr int kSums = 4;
  const std::size_t per_stream = size_bytes / kStreams / sizeof(Vector);
  const auto* vectors = reinterpret_cast<const Vector*>(words);
  Vector sums[kStreams * kSums] = {};
  for (std::size_t i = 0; i < per_stream; i += kSums) {
#pragma GCC unroll 8
    for (std::size_t s = 0; s < kStreams; ++s) {
#pragma GCC unroll 8
      for (std::size_t k = 0; k < kSums; ++k)
        sums[s * kSums + k] += vectors[s * per_stream + i + k];
    }
  }
  Vector total = {};
  for (const auto& sum : sums) total += sum;
  return total[0] + total[1] + total[2] + total[3];
}

#if defined(__x86_64__)

bool has_avx512f() { return __builtin_cpu_supports("avx512f"); }

/// @p kAhead  Bytes that are asked for in advance; 0 = the hardware's own guess alone.
template <int kStreams, int kAhead>
[[gnu::noinline, gnu::target("avx2")]] std::uint32_t avx2_sum(const std::uint32_t* words,
                                                              std::size_t size_bytes) {
  constexpr int kSums = 8 / kStreams;
  const std::size_t per_stream = size_bytes / kStreams / sizeof(__m256i);
  const auto* vectors = reinterpret_cast<const __m256i*>(words);
  __m256i sums[kStreams * kSums] = {};
  for (std::size_t i = 0; i < per_stream; i += kSums) {
#pragma GCC unroll 8
    for (std::size_t s = 0; s < kStreams; ++s) {
      const __m256i* from = vectors + s * per_stream + i;
      if constexpr (kAhead > 0) {
        // A line holds two vectors.
#pragma GCC unroll 8
        for (std::size_t k = 0; k < kSums; k += 2) {
          _mm_prefetch(reinterpret_cast<const char*>(from + k) + kAhead, _MM_HINT_T0);
        }
      }
#pragma GCC unroll 8
      for (std::size_t k = 0; k < kSums; ++k) {
        sums[s * kSums + k] = _mm256_add_epi32(sums[s * kSums + k], _mm256_load_si256(from + k));
      }
    }
  }
  __m256i total = _mm256_setzero_si256();
  for (const __m256i& sum : sums) total = _mm256_add_epi32(total, sum);
  std::array<std::uint32_t, 8> lanes;
  std::memcpy(lanes.data(), &total, sizeof total);
  std::uint32_t result = 0;
  for (const std::uint32_t lane : lanes) result += lane;
  return result;
}

[[gnu::noinline, gnu::target("avx512f")]] std::uint32_t avx512_sum(const std::uint32_t* words,
                                                                   std::size_t size_bytes) {
  constexpr int kSums = 8;
  __m512i sums[kSums] = {};
  const std::size_t count = size_bytes / sizeof(__m512i);
  for (std::size_t i = 0; i < count; i += kSums) {
#pragma GCC unroll 8
    for (std::size_t k = 0; k < kSums; ++k) {
      sums[k] = _mm512_add_epi32(sums[k], _mm512_load_si512(words + 16 * (i + k)));
    }
  }
  __m512i total = _mm512_setzero_si512();
  for (const __m512i& sum : sums) total = _mm512_add_epi32(total, sum);
  std::array<std::uint32_t, 16> lanes;
  std::memcpy(lanes.data(), &total, sizeof total);
  std::uint32_t result = 0;
  for (const std::uint32_t lane : lanes) result += lane;
  return result;
}

constexpr std::array kReadLoops = {
    ReadLoop{"128-bit loads, one stream", always, portable_sum<1>},
    ReadLoop{"AVX2 loads, one stream", has_avx2, avx2_sum<1, 0>},
    ReadLoop{"AVX2 loads, four streams", has_avx2, avx2_sum<4, 0>},
    ReadLoop{"AVX2 loads, prefetching 1 KiB ahead", has_avx2, avx2_sum<1, 1024>},
    ReadLoop{"AVX-512 loads, one stream", has_avx512f, avx512_sum}};

#else

constexpr std::array kReadLoops = {
    ReadLoop{"128-bit loads, one stream", always, portable_sum<1>},
    ReadLoop{"128-bit loads, four streams", always, portable_sum<4>}};

#endif

}  // namespace

std::span<const ReadLoop> read_loops() { return kReadLoops; }

}  // namespace pirt::cpu
