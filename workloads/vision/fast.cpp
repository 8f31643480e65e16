// FAST corners. What is computed is compiled twice, for any processor and for AVX2.

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "workloads/base/system/processor.h"
#include "workloads/vision/features.h"

namespace pirt::slam {
namespace {

// Vectors are not returned or taken by value: without AVX, those of 32 bytes have no ABI.
using Bytes16 = std::uint8_t __attribute__((vector_size(16)));
using Bytes32 = std::uint8_t __attribute__((vector_size(32)));

static_assert(std::endian::native == std::endian::little);  // bytes of words, in order

constexpr int kRim = kFeatureRim;
constexpr std::size_t kCircle = kFastCircle.size();
constexpr std::size_t kOpposite = kCircle / 2;
using Circle = std::array<std::ptrdiff_t, kCircle>;

template <typename Bytes>
[[gnu::always_inline]] inline void load(const std::uint8_t* from, Bytes& bytes) {
  std::memcpy(&bytes, from, sizeof bytes);
}

template <typename Bytes>
[[gnu::always_inline]] inline void lower(Bytes& a, const Bytes& b) {
  a = a < b ? a : b;
}

template <typename Bytes>
[[gnu::always_inline]] inline void raise(Bytes& a, const Bytes& b) {
  a = a > b ? a : b;
}

/// The largest of what each arc of 9 has as its smallest; with Up and Down changed, the other way.
///
/// Two arcs that begin beside each other share 8 pixels: with these, the better of the two ends.
template <typename Bytes, auto Down, auto Up>
[[gnu::always_inline]] inline void arcs(const std::array<Bytes, kCircle>& at, Bytes& best) {
  std::array<Bytes, kOpposite> two, four;
#pragma GCC unroll 8
  for (std::size_t i = 0; i < kOpposite; ++i) {
    two[i] = at[2 * i + 1];
    Down(two[i], at[(2 * i + 2) % kCircle]);
  }
#pragma GCC unroll 8
  for (std::size_t i = 0; i < kOpposite; ++i) {
    four[i] = two[i];
    Down(four[i], two[(i + 1) % kOpposite]);
  }
#pragma GCC unroll 8
  for (std::size_t i = 0; i < kOpposite; ++i) {
    Bytes nine = at[2 * i];
    Up(nine, at[(2 * i + 9) % kCircle]);
    Down(nine, four[i]);
    Down(nine, four[(i + 2) % kOpposite]);
    if (i == 0) {
      best = nine;
    } else {
      Up(best, nine);
    }
  }
}

/// Each pixel's contrast, from the first one of a vector on.
template <typename Bytes>
[[gnu::always_inline]] inline void contrasts(const std::uint8_t* first, const Circle& circle,
                                             Bytes& contrast) {
  std::array<Bytes, kCircle> at;
#pragma GCC unroll 16
  for (std::size_t i = 0; i < kCircle; ++i) load(first + circle[i], at[i]);
  Bytes here, brighter, darker;
  load(first, here);
  arcs<Bytes, lower<Bytes>, raise<Bytes>>(at, brighter);
  arcs<Bytes, raise<Bytes>, lower<Bytes>>(at, darker);
  raise(brighter, here);
  lower(darker, here);
  contrast = brighter - here;
  raise<Bytes>(contrast, here - darker);
}

template <typename Bytes>
[[gnu::always_inline]] inline void find(const GreyImage& image, std::uint8_t threshold,
                                        std::vector<FastCorner>& found) {
  constexpr int kLanes = sizeof(Bytes);
  Circle circle;
  for (std::size_t i = 0; i < kCircle; ++i) {
    circle[i] =
        static_cast<std::ptrdiff_t>(kFastCircle[i].second) * image.width + kFastCircle[i].first;
  }
  // Contrasts of three rows, from the pixel before the first that may be a corner on. The last
  // vector of a row may go beyond it, into the next one, where it is asked for no corner.
  static_assert(kRim >= 5 && 2 * kRim >= kLanes);
  const int columns = image.width - 2 * kRim;
  const int vectors = (columns + 2 + kLanes - 1) / kLanes;
  const auto stride = (static_cast<std::size_t>(vectors) + 1) * kLanes;
  std::vector<std::uint8_t> rows(3 * stride);
  const auto row = [&](int y) { return rows.data() + static_cast<std::size_t>(y % 3) * stride; };
  Bytes least;
  std::memset(&least, threshold, sizeof least);
  for (int y = kRim - 1; y <= image.height - kRim; ++y) {
    const std::uint8_t* pixels = image.row(y) + kRim - 1;
    for (int x = 0; x < vectors * kLanes; x += kLanes) {
      Bytes contrast;
      contrasts(pixels + x, circle, contrast);
      std::memcpy(row(y) + x, &contrast, sizeof contrast);
    }
    if (y < kRim + 1) continue;
    const std::uint8_t* above = row(y - 2);
    const std::uint8_t* middle = row(y - 1);
    const std::uint8_t* below = row(y);
    for (int x = 0; x < columns; x += kLanes) {
      Bytes here, most = least, near;
      load(middle + x + 1, here);
      for (int i = 0; i < 3; ++i) {
        load(above + x + i, near);
        raise(most, near);
        load(below + x + i, near);
        raise(most, near);
      }
      load(middle + x, near);
      raise(most, near);
      load(middle + x + 2, near);
      raise(most, near);
      const auto largest = here > most;
      std::array<std::uint64_t, kLanes / 8> words;
      std::memcpy(words.data(), &largest, sizeof largest);
      for (std::size_t i = 0; i < words.size(); ++i) {
        for (std::uint64_t left = words[i]; left != 0;) {
          const int byte = std::countr_zero(left) / 8;
          left &= ~(std::uint64_t{0xff} << (8 * byte));
          const int column = x + static_cast<int>(8 * i) + byte;
          if (column < columns) found.push_back({kRim + column, y - 1});
        }
      }
    }
  }
}

void find_anywhere(const GreyImage& image, std::uint8_t threshold, std::vector<FastCorner>& found) {
  find<Bytes16>(image, threshold, found);
}

#ifdef __x86_64__
[[gnu::target("avx2")]] void find_with_avx2(const GreyImage& image, std::uint8_t threshold,
                                            std::vector<FastCorner>& found) {
  find<Bytes32>(image, threshold, found);
}
#else
constexpr auto find_with_avx2 = find_anywhere;
#endif

}  // namespace

std::vector<FastCorner> fast_corners(const GreyImage& image, int threshold) {
  std::vector<FastCorner> found;
  if (threshold >= 255 || image.width <= 2 * kRim || image.height <= 2 * kRim) return found;
  (has_avx2() ? find_with_avx2 : find_anywhere)(
      image, static_cast<std::uint8_t>(std::max(threshold, 0)), found);
  return found;
}

}  // namespace pirt::slam
