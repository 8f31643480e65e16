// A point is followed by code that is compiled twice, for any processor and for AVX2; which one
// runs is decided when it is first needed. Without fused products both have the same bits.
#include "workloads/vision/pyramid.h"

#include <array>
#include <cassert>
#include <cmath>
#include <cstring>

#include "workloads/base/math/pixel_index.h"
#include "workloads/base/system/processor.h"

namespace pirt::slam {
namespace {

constexpr int kHalf = 7;
constexpr int kWindow = 2 * kHalf + 1;
constexpr int kOuter = kWindow + 2;
constexpr int kStride = 16;       // columns of a window, padded for vectors
constexpr int kOuterStride = 24;  // of a window with a rim of one
constexpr int kRight = 20;        // columns that are within the picture
constexpr float kCount = kWindow * kWindow;
constexpr std::size_t kTexels = std::size_t{kWindow} * kStride;
constexpr std::size_t kOuterTexels = std::size_t{kOuter} * kOuterStride;

GreyImage half_of(const GreyImage& image) {
  GreyImage half{(image.width + 1) / 2, (image.height + 1) / 2, {}};
  half.pixels.resize(static_cast<std::size_t>(half.width) * static_cast<std::size_t>(half.height));
  std::vector<std::uint16_t> column(static_cast<std::size_t>(image.width));
  for (int y = 0; y < half.height; ++y) {
    const auto* above = image.row(std::max(2 * y - 1, 0));
    const auto* here = image.row(2 * y);
    const auto* below = image.row(std::min(2 * y + 1, image.height - 1));
    for (std::size_t x = 0; x < column.size(); ++x) {
      column[x] = static_cast<std::uint16_t>(above[x] + 2 * here[x] + below[x]);
    }
    auto* out = half.row(y);
    const int last = image.width - 1;
    out[0] = static_cast<std::uint8_t>(
        (3 * column[0] + column[static_cast<std::size_t>(std::min(1, last))] + 8) >> 4);
    for (int x = 1; x < half.width; ++x) {
      const auto k = 2 * static_cast<std::size_t>(x);
      const auto right = std::min(k + 1, static_cast<std::size_t>(last));
      out[x] = static_cast<std::uint8_t>((column[k - 1] + 2 * column[k] + column[right] + 8) >> 4);
    }
  }
  return half;
}

/// Bilinear weights and the first pixel of a window.
struct Anchor {
  int x, y;
  float w00, w01, w10, w11;
};

/// Absent (false) where the window with @p rim leaves the picture.
[[gnu::always_inline]] inline bool anchor_at(const GreyImage& image, const Eigen::Vector2f& centre,
                                             int rim, Anchor& anchor) {
  const float left = centre.x() - static_cast<float>(kHalf + rim);
  const float top = centre.y() - static_cast<float>(kHalf + rim);
  const auto right = static_cast<float>(image.width - kRight - 1);
  const auto bottom = static_cast<float>(image.height - kOuter - 1);
  if (!(left >= 0 && top >= 0 && left < right && top < bottom)) return false;
  anchor.x = static_cast<int>(left);
  anchor.y = static_cast<int>(top);
  const float fx = left - static_cast<float>(anchor.x);
  const float fy = top - static_cast<float>(anchor.y);
  anchor.w00 = (1 - fx) * (1 - fy);
  anchor.w01 = fx * (1 - fy);
  anchor.w10 = (1 - fx) * fy;
  anchor.w11 = fx * fy;
  return true;
}

constexpr std::size_t kLanes = 8;
using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));

/// A window's next texels. (A value of this type is not returned: without AVX, that has no ABI.)
template <std::size_t kSize>
[[gnu::always_inline]] inline void load(const std::array<float, kSize>& window, std::size_t i,
                                        Lanes& lanes) {
  std::memcpy(&lanes, window.data() + i, sizeof lanes);
}

constexpr Lanes kInside = {1, 1, 1, 1, 1, 1, 1, 0};  // of the right half of a window's row

template <std::size_t kSize>
[[gnu::always_inline]] inline void store(const Lanes& lanes, std::array<float, kSize>& window,
                                         std::size_t i) {
  std::memcpy(window.data() + i, &lanes, sizeof lanes);
}

/// In an order that any width of registers can keep, so that all give the same bits.
[[gnu::always_inline]] inline float sum_of_eight(const Lanes& lanes) {
  return ((lanes[0] + lanes[4]) + (lanes[1] + lanes[5])) +
         ((lanes[2] + lanes[6]) + (lanes[3] + lanes[7]));
}

/// All pixels are converted first: what is loaded at once after it was stored in other pieces waits
/// until that has reached the cache. Those beyond what is within the picture are of the next row,
/// and not used.
template <int kRows, int kColumns>
[[gnu::always_inline]] inline void sample(const GreyImage& image, const Anchor& a,
                                          std::array<float, std::size_t{kRows} * kColumns>& out) {
  constexpr std::size_t kPixels = std::size_t{kRows + 1} * kColumns;
  alignas(64) std::array<float, kPixels + kLanes> pixels;
  for (int y = 0; y <= kRows; ++y) {
    const std::uint8_t* from = image.row(a.y + y) + a.x;
    float* to = &pixels[pixel_index(0, y, kColumns)];
    for (std::size_t x = 0; x < kColumns; ++x) to[x] = static_cast<float>(from[x]);
  }
  store(Lanes{}, pixels, kPixels);
  for (int y = 0; y < kRows; ++y) {
    for (std::size_t x = 0; x < kColumns; x += kLanes) {
      const std::size_t i = pixel_index(0, y, kColumns) + x;
      Lanes top, top_right, low, low_right;
      load(pixels, i, top);
      load(pixels, i + 1, top_right);
      load(pixels, i + kColumns, low);
      load(pixels, i + kColumns + 1, low_right);
      store(a.w00 * top + a.w01 * top_right + a.w10 * low + a.w11 * low_right, out, i);
    }
  }
}

/// A window that is followed deforms from one picture to the next: what it shows comes nearer, or
/// is seen more from the side. To first order its texels move by d + A u, u from its middle;
/// whoever looks for d alone finds the mean of that, weighted by the gradients, and so a place
/// beside the middle, each time in the same direction: 0.05 pixels a frame in a corridor, 0.9 after
/// 20 frames, where 0.4 are left with A. The unknowns: d and A, row by row.
constexpr std::size_t kMotions = 6;
/// What A may be expected to be, so that it is found where the noise lets it be.
constexpr float kDeformation = 0.02F;
constexpr float kGreyNoise = 3.0F;  // levels
/// Pixels; more than a window's own gradients could make of that is noise.
constexpr float kMostOff = 0.4F;

using Motions = std::array<float, kMotions>;

/// x of m x = b; m symmetric and positive definite, of which the lower triangle is read and lost.
[[gnu::always_inline]] inline void solve(std::array<Motions, kMotions>& m, Motions& b) {
  for (std::size_t c = 0; c < kMotions; ++c) {
    for (std::size_t k = 0; k < c; ++k) m[c][c] -= m[c][k] * m[c][k];
    m[c][c] = std::sqrt(m[c][c]);
    for (std::size_t r = c + 1; r < kMotions; ++r) {
      for (std::size_t k = 0; k < c; ++k) m[r][c] -= m[r][k] * m[c][k];
      m[r][c] /= m[c][c];
    }
  }
  for (std::size_t r = 0; r < kMotions; ++r) {
    for (std::size_t k = 0; k < r; ++k) b[r] -= m[r][k] * b[k];
    b[r] /= m[r][r];
  }
  for (std::size_t r = kMotions; r-- > 0;) {
    for (std::size_t k = r + 1; k < kMotions; ++k) b[r] -= m[k][r] * b[k];
    b[r] /= m[r][r];
  }
}

/// What is known of a window before it is looked for. Columns beyond the window have no gradient
/// and the weight 0.
struct Template {
  alignas(64) std::array<float, kTexels> value{}, gx{}, gy{};
  float xx = 0, xy = 0, yy = 0;
  float mean_x = 0, mean_y = 0;

  [[nodiscard]] bool make(const GreyImage& image, const Eigen::Vector2f& centre, float least_corner,
                          TrackWork& work);
};

[[gnu::always_inline]] inline bool Template::make(const GreyImage& image,
                                                  const Eigen::Vector2f& centre, float least_corner,
                                                  TrackWork& work) {
  Anchor anchor{};
  if (!anchor_at(image, centre, 1, anchor)) return false;
  ++work.windows;
  alignas(64) std::array<float, kOuterTexels> outer;
  sample<kOuter, kOuterStride>(image, anchor, outer);
  Lanes sums[5] = {};
  for (std::size_t y = 0; y < kWindow; ++y) {
    for (std::size_t x = 0; x < kStride; x += kLanes) {
      const std::size_t middle = (y + 1) * kOuterStride + x + 1;
      Lanes here, left, right, above, below;
      load(outer, middle, here);
      load(outer, middle - 1, left);
      load(outer, middle + 1, right);
      load(outer, middle - kOuterStride, above);
      load(outer, middle + kOuterStride, below);
      Lanes along_x = 0.5F * (right - left);
      Lanes along_y = 0.5F * (below - above);
      if (x > 0) {
        along_x *= kInside;
        along_y *= kInside;
      }
      store(here, value, y * kStride + x);
      store(along_x, gx, y * kStride + x);
      store(along_y, gy, y * kStride + x);
      sums[0] += along_x * along_x;
      sums[1] += along_x * along_y;
      sums[2] += along_y * along_y;
      sums[3] += along_x;
      sums[4] += along_y;
    }
  }
  xx = sum_of_eight(sums[0]);
  xy = sum_of_eight(sums[1]);
  yy = sum_of_eight(sums[2]);
  mean_x = sum_of_eight(sums[3]);
  mean_y = sum_of_eight(sums[4]);
  mean_x /= kCount;
  mean_y /= kCount;
  xx -= kCount * mean_x * mean_x;
  xy -= kCount * mean_x * mean_y;
  yy -= kCount * mean_y * mean_y;
  const float middle = 0.5F * (xx + yy);
  const float least = middle - std::sqrt(0.25F * (xx - yy) * (xx - yy) + xy * xy);
  return least >= least_corner * kCount;
}

enum class Match { kGood, kOutside, kDifferent };

/// The mean absolute difference but for @p mean, by which the window is brighter.
[[gnu::always_inline]] inline float difference_of(const Template& wanted,
                                                  const std::array<float, kTexels>& seen,
                                                  float mean) {
  Lanes sums = {};
  for (std::size_t k = 0; k < kTexels; k += kLanes) {
    Lanes difference, value;
    load(seen, k, difference);
    load(wanted.value, k, value);
    difference -= value + mean;
    if (k % kStride > 0) difference *= kInside;
    sums += difference < 0 ? -difference : difference;
  }
  return sum_of_eight(sums) / kCount;
}

/// By how much the middle of @p wanted lies beside where the window was found, in pixels.
/// @param seen  The window there. @param mean  By how much it is brighter.
[[gnu::always_inline]] inline Eigen::Vector2f middle_off(const Template& wanted,
                                                         const std::array<float, kTexels>& seen,
                                                         float mean) {
  // Columns and rows from the middle.
  alignas(64) static constexpr auto places = [] {
    std::array<std::array<float, kTexels>, 2> at{};
    for (int y = 0; y < kWindow; ++y) {
      for (int x = 0; x < kWindow; ++x) {
        at[0][pixel_index(x, y, kStride)] = static_cast<float>(x - kHalf);
        at[1][pixel_index(x, y, kStride)] = static_cast<float>(y - kHalf);
      }
    }
    return at;
  }();
  Lanes products[kMotions][kMotions] = {};
  Lanes sums[kMotions] = {};
  Lanes differences[kMotions] = {};
  for (std::size_t k = 0; k < kTexels; k += kLanes) {
    Lanes difference, value, column, row, motion[kMotions];
    load(seen, k, difference);
    load(wanted.value, k, value);
    load(wanted.gx, k, motion[0]);
    load(wanted.gy, k, motion[1]);
    load(places[0], k, column);
    load(places[1], k, row);
    motion[2] = motion[0] * column;
    motion[3] = motion[0] * row;
    motion[4] = motion[1] * column;
    motion[5] = motion[1] * row;
    difference -= value;
    for (std::size_t i = 0; i < kMotions; ++i) {
      for (std::size_t j = 0; j <= i; ++j) products[i][j] += motion[i] * motion[j];
      sums[i] += motion[i];
      differences[i] += motion[i] * difference;
    }
  }
  std::array<Motions, kMotions> m{};
  Motions b{};
  for (std::size_t i = 0; i < kMotions; ++i) {
    const float sum = sum_of_eight(sums[i]);
    b[i] = sum_of_eight(differences[i]) - mean * sum;
    for (std::size_t j = 0; j <= i; ++j) {
      m[i][j] = sum_of_eight(products[i][j]) - sum * sum_of_eight(sums[j]) / kCount;
    }
    if (i >= 2) m[i][i] += (kGreyNoise / kDeformation) * (kGreyNoise / kDeformation);
  }
  solve(m, b);
  return {b[0], b[1]};
}

/// Moves @p at to where the window looks like @p wanted.
/// @param finest  Then the window may have deformed, too. @param error  Then how unlike it looks.
[[gnu::always_inline]] inline Match align(const Template& wanted, const GreyImage& image,
                                          const TrackOptions& options, bool finest,
                                          Eigen::Vector2f& at, float& error, TrackWork& work) {
  const float determinant = wanted.xx * wanted.yy - wanted.xy * wanted.xy;
  alignas(64) std::array<float, kTexels> seen;
  const Eigen::Vector2f start = at;
  for (int i = 0; i < options.iterations; ++i) {
    Anchor anchor{};
    if (!anchor_at(image, at, 0, anchor)) return Match::kOutside;
    ++work.steps;
    sample<kWindow, kStride>(image, anchor, seen);
    Lanes along_x = {};
    Lanes along_y = {};
    Lanes all = {};
    for (std::size_t k = 0; k < kTexels; k += kLanes) {
      Lanes difference, value, x, y;
      load(seen, k, difference);
      load(wanted.value, k, value);
      load(wanted.gx, k, x);
      load(wanted.gy, k, y);
      difference -= value;
      along_x += difference * x;
      along_y += difference * y;
      if (k % kStride > 0) difference *= kInside;
      all += difference;
    }
    const float sum = sum_of_eight(all);
    const float x = sum_of_eight(along_x) - sum * wanted.mean_x;
    const float y = sum_of_eight(along_y) - sum * wanted.mean_y;
    const Eigen::Vector2f step((wanted.yy * x - wanted.xy * y) / determinant,
                               (wanted.xx * y - wanted.xy * x) / determinant);
    at -= step;
    if (!((at - start).norm() < 2.0F * kWindow)) return Match::kDifferent;
    if (step.squaredNorm() > options.enough * options.enough && i + 1 < options.iterations)
      continue;
    if (finest) {
      ++work.looks;
      const float mean = sum / kCount;
      error = difference_of(wanted, seen, mean);
      const Eigen::Vector2f off = middle_off(wanted, seen, mean) - step;
      if (off.squaredNorm() < kMostOff * kMostOff) at -= off;
    }
    break;
  }
  return Match::kGood;
}

Eigen::Vector2f at_level(const Eigen::Vector2f& pixel, std::size_t level) {
  return pixel / static_cast<float>(1U << level);
}

[[gnu::always_inline]] inline TrackedPoint track(const Pyramid& from, const Pyramid& to,
                                                 const Eigen::Vector2f& point,
                                                 const Eigen::Vector2f& guess,
                                                 const TrackOptions& options, TrackWork& done) {
  TrackedPoint tracked{guess, false};
  Template wanted;
  const auto least = static_cast<float>(options.least_corner);
  for (std::size_t level = from.levels.size(); level-- > 0;) {
    // Coarse levels help where they can; only the finest one must succeed.
    const bool finest = level == 0;
    if (!wanted.make(from.levels[level], at_level(point, level), finest ? least : least / 4,
                     done)) {
      if (finest) return tracked;
      continue;
    }
    Eigen::Vector2f at = at_level(tracked.pixel, level);
    float error = 0;
    const Match match = align(wanted, to.levels[level], options, finest, at, error, done);
    if (match != Match::kGood || (finest && error > static_cast<float>(options.most_error))) {
      if (finest) return tracked;
      continue;
    }
    tracked.pixel = at * static_cast<float>(1U << level);
  }
  if (options.back > 0) {
    Eigen::Vector2f at = point;
    float error = 0;
    if (!wanted.make(to.levels[0], tracked.pixel, 0.0F, done)) return tracked;
    if (align(wanted, from.levels[0], options, false, at, error, done) != Match::kGood)
      return tracked;
    if ((at - point).norm() > static_cast<float>(options.back)) return tracked;
  }
  tracked.found = true;
  return tracked;
}

TrackedPoint track_anywhere(const Pyramid& from, const Pyramid& to, const Eigen::Vector2f& point,
                            const Eigen::Vector2f& guess, const TrackOptions& options,
                            TrackWork& work) {
  return track(from, to, point, guess, options, work);
}

#ifdef __x86_64__
[[gnu::target("avx2")]] TrackedPoint track_with_avx2(const Pyramid& from, const Pyramid& to,
                                                     const Eigen::Vector2f& point,
                                                     const Eigen::Vector2f& guess,
                                                     const TrackOptions& options, TrackWork& work) {
  return track(from, to, point, guess, options, work);
}
#else
constexpr auto track_with_avx2 = track_anywhere;
#endif

}  // namespace

Pyramid make_pyramid(GreyImage image, int levels) {
  Pyramid pyramid;
  pyramid.levels.push_back(std::move(image));
  while (std::ssize(pyramid.levels) < levels) {
    pyramid.levels.push_back(half_of(pyramid.levels.back()));
  }
  return pyramid;
}

TrackedPoint track_feature(const Pyramid& from, const Pyramid& to, const Eigen::Vector2f& point,
                           const Eigen::Vector2f& guess, const TrackOptions& options,
                           TrackWork* work) {
  static const auto best = has_avx2() ? track_with_avx2 : track_anywhere;
  TrackWork ignored;
  return best(from, to, point, guess, options, work != nullptr ? *work : ignored);
}

std::vector<TrackedPoint> track_features(const Pyramid& from, const Pyramid& to,
                                         std::span<const Eigen::Vector2f> points,
                                         std::span<const Eigen::Vector2f> guesses,
                                         const TrackOptions& options) {
  assert(points.size() == guesses.size());
  assert(from.levels.size() == to.levels.size());
  std::vector<TrackedPoint> tracked;
  tracked.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    tracked.push_back(track_feature(from, to, points[i], guesses[i], options));
  }
  return tracked;
}

}  // namespace pirt::slam
