#include "workloads/vision/features.h"

#include <cmath>
#include <opencv2/core/hal/hal.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "workloads/base/error.h"

namespace pirt::slam {
namespace {

constexpr int kRim = kFeatureRim;
constexpr int kHalf = kFeatureScoreHalf;

/// Shi and Tomasi's score of the window around a pixel.
float score_at(const GreyImage& image, int x, int y) {
  int xx = 0;
  int xy = 0;
  int yy = 0;
  for (int dy = -kHalf; dy <= kHalf; ++dy) {
    const auto* row = image.row(y + dy) + x;
    for (int dx = -kHalf; dx <= kHalf; ++dx) {
      const int gx = row[dx + 1] - row[dx - 1];
      const int gy = row[dx + image.width] - row[dx - image.width];
      xx += gx * gx;
      xy += gx * gy;
      yy += gy * gy;
    }
  }
  return corner_score(xx, xy, yy);
}

/// The centre of the gradients' energy in the window that is followed (mean shift). A tracker that
/// does not know of zoom and turn follows this centre; any other pixel of the window would move
/// against the scene as the view changes.
Eigen::Vector2f refined(const GreyImage& image, int x, int y) {
  constexpr int kWindowHalf = kFeatureWindowHalf;
  Eigen::Vector2f centre(static_cast<float>(x), static_cast<float>(y));
  const Eigen::Vector2f start = centre;
  for (int step = 0; step < kFeatureRefineSteps; ++step) {
    const int cx = static_cast<int>(std::lround(centre.x()));
    const int cy = static_cast<int>(std::lround(centre.y()));
    std::int64_t weight = 0;
    std::int64_t sum_x = 0;
    std::int64_t sum_y = 0;
    for (int dy = -kWindowHalf; dy <= kWindowHalf; ++dy) {
      const auto* row = image.row(cy + dy) + cx;
      int row_weight = 0;
      int row_x = 0;
      for (int dx = -kWindowHalf; dx <= kWindowHalf; ++dx) {
        const int gx = row[dx + 1] - row[dx - 1];
        const int gy = row[dx + image.width] - row[dx - image.width];
        const int energy = gx * gx + gy * gy;
        row_weight += energy;
        row_x += energy * dx;
      }
      weight += row_weight;
      sum_x += row_x;
      sum_y += std::int64_t{row_weight} * dy;
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

Descriptor describe(const cv::Mat& blurred, std::span<const PatchPair, 256> pattern, int x, int y) {
  Descriptor descriptor{};
  const std::uint8_t* centre = blurred.ptr(y) + x;
  const auto stride = static_cast<std::ptrdiff_t>(blurred.step);
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    const PatchPair& p = pattern[i];
    if (centre[p.ay * stride + p.ax] < centre[p.by * stride + p.bx]) {
      descriptor[i / 8] = static_cast<std::uint8_t>(descriptor[i / 8] | (1U << (i % 8)));
    }
  }
  return descriptor;
}

std::vector<FastCorner> corners_of(const GreyImage& image, const std::vector<cv::KeyPoint>& found) {
  std::vector<FastCorner> corners;
  for (const auto& key : found) {
    const int x = static_cast<int>(key.pt.x);
    const int y = static_cast<int>(key.pt.y);
    if (x < kRim || y < kRim || x >= image.width - kRim || y >= image.height - kRim) continue;
    corners.push_back({x, y, score_at(image, x, y)});
  }
  return corners;
}

}  // namespace

int distance(const Descriptor& a, const Descriptor& b) {
  return cv::hal::normHamming(a.data(), b.data(), static_cast<int>(a.size()));
}

Features extract_features(const GreyImage& image, const FeatureOptions& options) {
  const auto pattern = descriptor_pattern();
  Features features;
  if (image.width <= 2 * kRim || image.height <= 2 * kRim) return features;
  try {
    const cv::Mat pixels(image.height, image.width, CV_8U,
                         const_cast<std::uint8_t*>(image.pixels.data()));
    std::vector<cv::KeyPoint> found;
    cv::FAST(pixels, found, options.threshold, true);
    const auto corners = best_corners(corners_of(image, found), image.width, image.height, options);
    cv::Mat blurred;
    if (!corners.empty()) cv::GaussianBlur(pixels, blurred, {7, 7}, 2.0);
    for (const FastCorner& corner : corners) {
      features.pixels.push_back(refined(image, corner.x, corner.y));
      features.scores.push_back(corner.score);
      features.descriptors.push_back(describe(blurred, pattern, corner.x, corner.y));
    }
  } catch (const cv::Exception& error) {
    throw_environment("OpenCV cannot find corners: " + error.err);
  }
  return features;
}

}  // namespace pirt::slam
