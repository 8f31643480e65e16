#include "workloads/vision/features.h"

#include <array>
#include <cmath>
#include <opencv2/core/hal/hal.hpp>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>

#include "workloads/base/error.h"

namespace pirt::slam {
namespace {

constexpr int kHalf = kFeatureScoreHalf;

/// Twice the gradients of the next eight pixels of a row.
struct Gradients {
  cv::v_int16x8 x, y;
};

Gradients gradients(const std::uint8_t* pixels, int stride) {
  const auto at = [pixels](std::ptrdiff_t offset) {
    return cv::v_reinterpret_as_s16(cv::v_load_expand(pixels + offset));
  };
  return {at(1) - at(-1), at(stride) - at(-stride)};
}

/// Shi and Tomasi's score of the window around a pixel.
float score_at(const GreyImage& image, int x, int y) {
  static_assert(2 * kHalf + 2 == 8);  // The last one is beside the window.
  const cv::v_int16x8 inside(-1, -1, -1, -1, -1, -1, -1, 0);
  cv::v_int32x4 xx = cv::v_setzero_s32(), xy = xx, yy = xx;
  const auto* row = image.row(y - kHalf) + x - kHalf;
  for (int dy = -kHalf; dy <= kHalf; ++dy, row += image.width) {
    Gradients g = gradients(row, image.width);
    g.x &= inside;
    xx += cv::v_dotprod(g.x, g.x);
    xy += cv::v_dotprod(g.x, g.y);
    yy += cv::v_dotprod(g.y & inside, g.y);
  }
  return corner_score(cv::v_reduce_sum(xx), cv::v_reduce_sum(xy), cv::v_reduce_sum(yy));
}

/// The centre of the gradients' energy in the window that is followed (mean shift). A tracker that
/// does not know of zoom and turn follows this centre; any other pixel of the window would move
/// against the scene as the view changes.
Eigen::Vector2f refined(const GreyImage& image, int x, int y) {
  constexpr int kWindowHalf = kFeatureWindowHalf;
  static_assert(2 * kWindowHalf + 2 == 16);  // The last one is beside the window.
  constexpr std::size_t kParts = 4;
  const cv::v_int32x4 inside[kParts] = {{1, 1, 1, 1}, {1, 1, 1, 1}, {1, 1, 1, 1}, {1, 1, 1, 0}};
  const cv::v_int32x4 columns[kParts] = {
      {-7, -6, -5, -4}, {-3, -2, -1, 0}, {1, 2, 3, 4}, {5, 6, 7, 0}};
  Eigen::Vector2f centre(static_cast<float>(x), static_cast<float>(y));
  const Eigen::Vector2f start = centre;
  for (int step = 0; step < kFeatureRefineSteps; ++step) {
    const int cx = static_cast<int>(std::lround(centre.x()));
    const int cy = static_cast<int>(std::lround(centre.y()));
    // Of each column; in the end, those of each row are 8 - dy times in the second.
    std::array<cv::v_int32x4, kParts> energies, sums;
    energies.fill(cv::v_setzero_s32());
    sums.fill(cv::v_setzero_s32());
    const auto* row = image.row(cy - kWindowHalf) + cx - kWindowHalf;
    for (int dy = -kWindowHalf; dy <= kWindowHalf; ++dy, row += image.width) {
      for (std::size_t half = 0; half < 2; ++half) {
        const Gradients g = gradients(row + 8 * half, image.width);
        cv::v_int16x8 low, high;
        cv::v_zip(g.x, g.y, low, high);
        energies[2 * half] += cv::v_dotprod(low, low);
        energies[2 * half + 1] += cv::v_dotprod(high, high);
      }
      for (std::size_t part = 0; part < kParts; ++part) sums[part] += energies[part];
    }
    int weight = 0, sum_x = 0, sum_y = 0;  // At most 15^2 * 7 * 2 * 255^2: they fit.
    for (std::size_t part = 0; part < kParts; ++part) {
      const auto all = energies[part] * inside[part];
      weight += cv::v_reduce_sum(all);
      sum_x += cv::v_reduce_sum(energies[part] * columns[part]);
      sum_y +=
          (kWindowHalf + 1) * cv::v_reduce_sum(all) - cv::v_reduce_sum(sums[part] * inside[part]);
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

}  // namespace

int distance(const Descriptor& a, const Descriptor& b) {
  return cv::hal::normHamming(a.data(), b.data(), static_cast<int>(a.size()));
}

Features extract_features(const GreyImage& image, const FeatureOptions& options) {
  Features features;
  auto found = fast_corners(image, options.threshold);
  for (FastCorner& corner : found) corner.score = score_at(image, corner.x, corner.y);
  const auto corners = best_corners(found, image.width, image.height, options);
  if (corners.empty()) return features;
  try {
    const cv::Mat pixels(image.height, image.width, CV_8U,
                         const_cast<std::uint8_t*>(image.pixels.data()));
    cv::Mat blurred;
    cv::GaussianBlur(pixels, blurred, {7, 7}, 2.0);
    const auto looks = looks_of(descriptor_pattern(), static_cast<std::ptrdiff_t>(blurred.step));
    for (const FastCorner& corner : corners) {
      features.pixels.push_back(refined(image, corner.x, corner.y));
      features.scores.push_back(corner.score);
      features.descriptors.push_back(describe(blurred.ptr(corner.y) + corner.x, looks));
    }
  } catch (const cv::Exception& error) {
    throw_environment("OpenCV cannot blur a picture: " + error.err);
  }
  return features;
}

}  // namespace pirt::slam
