// What the peak loops of all backends compute, and how their results are checked.
//
// Arithmetic loops run the chain x = x * a + b on many independent values; reading loops sum 32-bit
// words modulo 2^32, which no order of adding changes. Both are followed exactly.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "workloads/base/math/random.h"

namespace pirt::peak_math {

/// The chain moves from its start by about e^(-iterations/131072) towards 0.75: each iteration
/// counts, and no value leaves [0.75, 2].
inline constexpr float kFactor = 1.0F - 0x1p-17F;
inline constexpr float kAddend = 0.75F * 0x1p-17F;
/// Chains start at 1 + k/32 for k below this.
inline constexpr int kStarts = 8;
[[nodiscard]] inline float start_of(int k) { return 1.0F + static_cast<float>(k) / 32; }

/// A multiply-add may round once or twice; which one, hardware and compiler decide.
enum class Rounding : std::uint8_t { kOnce, kTwice };

/// Where a chain from @p start is after @p iterations.
[[nodiscard]] inline float follow_chain(float start, std::int64_t iterations, Rounding rounding) {
  float x = start;
  for (std::int64_t i = 0; i < iterations; ++i) {
    if (rounding == Rounding::kOnce) {
      x = std::fma(x, kFactor, kAddend);
    } else {
      const volatile float product = x * kFactor;  // volatile: not to be fused here
      x = product + kAddend;
    }
  }
  return x;
}

/// Fills @p words with a seeded stream and returns their sum modulo 2^32.
inline std::uint32_t fill_words(std::span<std::uint32_t> words, std::uint64_t seed) {
  std::uint32_t sum = 0;
  std::uint64_t state = hash_u64(seed, 0) | 1U;
  for (std::uint32_t& word : words) {
    // xorshift64: three shifts a word, where hashing each would take longer than measuring. @source
    // Marsaglia, Xorshift RNGs, 2003.
    state ^= state << 13U;
    state ^= state >> 7U;
    state ^= state << 17U;
    word = static_cast<std::uint32_t>(state >> 32U);
    sum += word;
  }
  return sum;
}

}  // namespace pirt::peak_math
