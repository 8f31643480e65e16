#include "workloads/vision/features.h"

#include <array>
#include <cmath>
#include <cstring>
#include <opencv2/core/hal/hal.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "workloads/base/error.h"
#include "workloads/base/math/lanes.h"
#include "workloads/base/system/processor.h"

namespace pirt::slam {
namespace {

constexpr int kRim = kFeatureRim;
constexpr int kHalf = kFeatureScoreHalf;

constexpr int kLanes = 8;
using Lanes = int __attribute__((vector_size(kLanes * sizeof(int))));

/// Twice the gradients of the next pixels of a row. (Values of this type are not returned: without
/// AVX, that has no ABI.)
[[gnu::always_inline]] inline void gradients(const std::uint8_t* pixels, int stride, Lanes& gx,
                                             Lanes& gy) {
  const std::uint8_t* above = pixels - stride;
  const std::uint8_t* below = pixels + stride;
  int x[kLanes], y[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    x[i] = pixels[i + 1] - pixels[i - 1];
    y[i] = below[i] - above[i];
  }
  std::memcpy(&gx, x, sizeof gx);
  std::memcpy(&gy, y, sizeof gy);
}

/// Shi and Tomasi's score of the window around a pixel.
[[gnu::always_inline]] inline float score_at(const GreyImage& image, int x, int y) {
  static_assert(2 * kHalf + 2 == kLanes);  // The last one is beside the window.
  constexpr Lanes kInside = {1, 1, 1, 1, 1, 1, 1, 0};
  Lanes xx = {}, xy = {}, yy = {};
  const auto* row = image.row(y - kHalf) + x - kHalf;
  for (int dy = -kHalf; dy <= kHalf; ++dy, row += image.width) {
    Lanes gx, gy;
    gradients(row, image.width, gx, gy);
    xx += gx * gx;
    xy += gx * gy;
    yy += gy * gy;
  }
  return corner_score(sum_of_eight(xx * kInside), sum_of_eight(xy * kInside),
                      sum_of_eight(yy * kInside));
}

/// The centre of the gradients' energy in the window that is followed (mean shift). A tracker that
/// does not know of zoom and turn follows this centre; any other pixel of the window would move
/// against the scene as the view changes.
[[gnu::always_inline]] inline Eigen::Vector2f refined(const GreyImage& image, int x, int y) {
  constexpr int kWindowHalf = kFeatureWindowHalf;
  static_assert(2 * kWindowHalf + 2 == 2 * kLanes);  // The last one is beside the window.
  constexpr Lanes kInside[] = {{1, 1, 1, 1, 1, 1, 1, 1}, {1, 1, 1, 1, 1, 1, 1, 0}};
  constexpr Lanes kColumns[] = {{-7, -6, -5, -4, -3, -2, -1, 0}, {1, 2, 3, 4, 5, 6, 7, 0}};
  Eigen::Vector2f centre(static_cast<float>(x), static_cast<float>(y));
  const Eigen::Vector2f start = centre;
  for (int step = 0; step < kFeatureRefineSteps; ++step) {
    const int cx = static_cast<int>(std::lround(centre.x()));
    const int cy = static_cast<int>(std::lround(centre.y()));
    int weight = 0, sum_x = 0, sum_y = 0;  // At most 15^2 * 7 * 2 * 255^2: they fit.
    for (std::size_t part = 0; part < 2; ++part) {
      Lanes energies = {}, sums = {};
      const auto* row = image.row(cy - kWindowHalf) + cx - kWindowHalf + part * std::size_t{kLanes};
      for (int dy = -kWindowHalf; dy <= kWindowHalf; ++dy, row += image.width) {
        Lanes gx, gy;
        gradients(row, image.width, gx, gy);
        energies += gx * gx + gy * gy;
        sums += energies;  // In the end each row's, 8 - dy times.
      }
      weight += sum_of_eight(energies * kInside[part]);
      sum_x += sum_of_eight(energies * kColumns[part]);
      sum_y += sum_of_eight(((kWindowHalf + 1) * energies - sums) * kInside[part]);
    }
    if (weight == 0) break;
    const Eigen::Vector2f next(
        static_cast<float>(cx) + static_cast<float>(sum_x) / static_cast<float>(weight),
        static_cast<float>(cy) + static_cast<float>(sum_y) / static_cast<float>(weight));
    if ((next - start).norm() > kFeatureFarthest) break;
    centre = next;
  }
  return centre;
}

// What is computed of many pixels is compiled twice, for any processor and for AVX2: integers, so
// that both have the same bits.

[[gnu::always_inline]] inline void score_all(const GreyImage& image,
                                             std::span<FastCorner> corners) {
  for (FastCorner& corner : corners) corner.score = score_at(image, corner.x, corner.y);
}

[[gnu::always_inline]] inline void refine_all(const GreyImage& image,
                                              std::span<const FastCorner> corners,
                                              std::vector<Eigen::Vector2f>& pixels) {
  pixels.reserve(corners.size());
  for (const FastCorner& corner : corners) pixels.push_back(refined(image, corner.x, corner.y));
}

void score_anywhere(const GreyImage& image, std::span<FastCorner> corners) {
  score_all(image, corners);
}

void refine_anywhere(const GreyImage& image, std::span<const FastCorner> corners,
                     std::vector<Eigen::Vector2f>& pixels) {
  refine_all(image, corners, pixels);
}

#ifdef __x86_64__
[[gnu::target("avx2")]] void score_with_avx2(const GreyImage& image,
                                             std::span<FastCorner> corners) {
  score_all(image, corners);
}

[[gnu::target("avx2")]] void refine_with_avx2(const GreyImage& image,
                                              std::span<const FastCorner> corners,
                                              std::vector<Eigen::Vector2f>& pixels) {
  refine_all(image, corners, pixels);
}

#else
constexpr auto score_with_avx2 = score_anywhere;
constexpr auto refine_with_avx2 = refine_anywhere;
#endif

/// Where a descriptor looks, from a picture's pixel on.
struct Look {
  std::ptrdiff_t a = 0, b = 0;
};

std::array<Look, 256> looks_of(std::span<const PatchPair, 256> pattern, std::ptrdiff_t stride) {
  std::array<Look, 256> looks;
  for (std::size_t i = 0; i < looks.size(); ++i) {
    const PatchPair& p = pattern[i];
    looks[i] = {p.ay * stride + p.ax, p.by * stride + p.bx};
  }
  return looks;
}

Descriptor describe(const std::uint8_t* centre, std::span<const Look, 256> looks) {
  Descriptor descriptor{};
  for (std::size_t byte = 0; byte < descriptor.size(); ++byte) {
    unsigned bits = 0;
    for (std::size_t i = 0; i < 8; ++i) {
      const Look& look = looks[8 * byte + i];
      bits |= static_cast<unsigned>(centre[look.a] < centre[look.b]) << i;
    }
    descriptor[byte] = static_cast<std::uint8_t>(bits);
  }
  return descriptor;
}

std::vector<FastCorner> corners_of(const GreyImage& image, const std::vector<cv::KeyPoint>& found) {
  std::vector<FastCorner> corners;
  for (const auto& key : found) {
    const int x = static_cast<int>(key.pt.x);
    const int y = static_cast<int>(key.pt.y);
    if (x < kRim || y < kRim || x >= image.width - kRim || y >= image.height - kRim) continue;
    corners.push_back({x, y, 0});
  }
  (has_avx2() ? score_with_avx2 : score_anywhere)(image, corners);
  return corners;
}

}  // namespace

int distance(const Descriptor& a, const Descriptor& b) {
  return cv::hal::normHamming(a.data(), b.data(), static_cast<int>(a.size()));
}

Features extract_features(const GreyImage& image, const FeatureOptions& options) {
  Features features;
  if (image.width <= 2 * kRim || image.height <= 2 * kRim) return features;
  try {
    const cv::Mat pixels(image.height, image.width, CV_8U,
                         const_cast<std::uint8_t*>(image.pixels.data()));
    std::vector<cv::KeyPoint> found;
    cv::FAST(pixels, found, options.threshold, true);
    const auto corners = best_corners(corners_of(image, found), image.width, image.height, options);
    if (corners.empty()) return features;
    cv::Mat blurred;
    cv::GaussianBlur(pixels, blurred, {7, 7}, 2.0);
    const auto looks = looks_of(descriptor_pattern(), static_cast<std::ptrdiff_t>(blurred.step));
    (has_avx2() ? refine_with_avx2 : refine_anywhere)(image, corners, features.pixels);
    for (const FastCorner& corner : corners) {
      features.scores.push_back(corner.score);
      features.descriptors.push_back(describe(blurred.ptr(corner.y) + corner.x, looks));
    }
  } catch (const cv::Exception& error) {
    throw_environment("OpenCV cannot find corners: " + error.err);
  }
  return features;
}

}  // namespace pirt::slam
