// Features found and followed from picture to picture.
#include "workloads/vision/features.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/features2d.hpp>

#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/base/math/random.h"
#include "workloads/vision/pyramid.h"

namespace pirt::slam {
namespace {

using testing::ElementsAreArray;

GreyImage shifted_pattern(double dx, double dy) {
  GreyImage image{200, 160, {}};
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double u = x - dx;
      const double v = y - dy;
      const double value = 128 + 40 * std::sin(u / 3.1) * std::cos(v / 4.3) +
                           30 * std::sin((u + 2 * v) / 11.0) + 20 * std::cos((v - u) / 7.0);
      image.pixels.push_back(static_cast<std::uint8_t>(std::lround(value)));
    }
  }
  return image;
}

/// Grey levels, each as likely as another, over @p contrast around the middle.
GreyImage noise(int width, int height, int contrast, std::uint64_t seed) {
  Random random(seed);
  GreyImage image{width, height, {}};
  for (int i = 0; i < width * height; ++i) {
    image.pixels.push_back(static_cast<std::uint8_t>(
        127 - contrast / 2 +
        static_cast<int>(random.below(static_cast<std::uint64_t>(contrast) + 1))));
  }
  return image;
}

TEST(TrackFeatures, FindsAKnownShiftToAFewHundredthsOfAPixel) {
  const Pyramid from = make_pyramid(shifted_pattern(0, 0));
  const Pyramid to = make_pyramid(shifted_pattern(3.4, -2.3));
  std::vector<Eigen::Vector2f> points;
  for (int y = 40; y < 120; y += 16) {
    for (int x = 40; x < 160; x += 16) points.emplace_back(x, y);
  }
  const auto tracked = track_features(from, to, points, points, {});
  int found = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!tracked[i].found) continue;
    ++found;
    EXPECT_LT((tracked[i].pixel - points[i] - Eigen::Vector2f(3.4F, -2.3F)).norm(), 0.06F);
  }
  EXPECT_EQ(found, static_cast<int>(points.size()));
}

TEST(TrackFeatures, FindsNothingInABlackPictureOrAtTheRim) {
  const Pyramid from = make_pyramid(shifted_pattern(0, 0));
  GreyImage black{200, 160, std::vector<std::uint8_t>(std::size_t{200} * 160, 0)};
  const std::vector<Eigen::Vector2f> points = {{100, 80}, {2, 2}, {199, 159}};
  for (const auto& t : track_features(from, make_pyramid(black), points, points, {})) {
    EXPECT_FALSE(t.found);
  }
  const auto same = track_features(from, from, points, points, {});
  EXPECT_TRUE(same[0].found);
  EXPECT_FALSE(same[1].found || same[2].found);
}

/// Where a window and its rim are within the picture, every pixel is followed, to the last one.
TEST(TrackFeatures, FollowsUpToTheRim) {
  for (const auto& [width, height] : {std::pair{64, 48}, {37, 29}, {23, 20}}) {
    const Pyramid picture = make_pyramid(noise(width, height, 100, 1), 1);
    std::vector<Eigen::Vector2f> points;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) points.emplace_back(x, y);
    }
    const auto tracked = track_features(picture, picture, points, points, {});
    for (std::size_t i = 0; i < points.size(); ++i) {
      const bool within = points[i].x() >= 8 && points[i].y() >= 8 &&
                          points[i].x() < static_cast<float>(width - 14) &&
                          points[i].y() < static_cast<float>(height - 11);
      EXPECT_EQ(tracked[i].found, within) << points[i].transpose();
      EXPECT_LE((tracked[i].pixel - points[i]).norm(), 1e-3F);
    }
  }
}

/// In pictures of any width, so that the last vector of a row ends everywhere, and of little
/// contrast, where many neighbours are equal.
TEST(FastCorners, AreOpenCvs) {
  std::size_t found = 0;
  for (int i = 0; i < 200; ++i) {
    const int contrast = i % 2 == 0 ? 255 : 40;
    GreyImage image = noise(41 + i % 70, 41 + i % 7, contrast, static_cast<std::uint64_t>(i));
    const int threshold = std::array{12, 0, 30, 60, 1, 200, 255}[static_cast<std::size_t>(i) % 7];
    const cv::Mat pixels(image.height, image.width, CV_8U, image.pixels.data());
    std::vector<cv::KeyPoint> keys;
    cv::FAST(pixels, keys, threshold, true);
    std::vector<std::pair<int, int>> expected;
    for (const auto& key : keys) {
      const int x = static_cast<int>(key.pt.x);
      const int y = static_cast<int>(key.pt.y);
      if (std::min({x, y, image.width - 1 - x, image.height - 1 - y}) < kFeatureRim) continue;
      expected.emplace_back(x, y);
    }
    std::vector<std::pair<int, int>> corners;
    for (const auto& corner : fast_corners(image, threshold)) {
      corners.emplace_back(corner.x, corner.y);
    }
    EXPECT_THAT(corners, ElementsAreArray(expected)) << i;
    found += corners.size();
  }
  EXPECT_GT(found, 500U);
  EXPECT_TRUE(fast_corners({40, 300, std::vector<std::uint8_t>(12000, 9)}, 12).empty());
}

TEST(ExtractFeatures, KnowsPlacesAgainInTheNextPicture) {
  const auto sequence = generate_sequence(test::scene(3, 4.0, false));
  const auto a = extract_features(sequence.image(80, 0), {});
  const auto b = extract_features(sequence.image(81, 0), {});
  ASSERT_GT(a.pixels.size(), 200U);
  EXPECT_LE(a.pixels.size(), 400U);
  EXPECT_TRUE(std::ranges::is_sorted(a.scores, std::greater<>()));
  int near = 0;
  int matched = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    std::size_t best = 0;
    for (std::size_t k = 1; k < b.pixels.size(); ++k) {
      if (distance(a.descriptors[i], b.descriptors[k]) <
          distance(a.descriptors[i], b.descriptors[best])) {
        best = k;
      }
    }
    if (distance(a.descriptors[i], b.descriptors[best]) > 30) continue;
    ++matched;
    if ((a.pixels[i] - b.pixels[best]).norm() < 25) ++near;  // 60 degrees/s are 16 pixels a frame
  }
  EXPECT_GT(matched, 60);
  EXPECT_GT(near, 95 * matched / 100);
}

TEST(ExtractFeatures, FindsNoneInAConstantPicture) {
  EXPECT_TRUE(
      extract_features({320, 240, std::vector<std::uint8_t>(std::size_t{320} * 240, 90)}, {})
          .pixels.empty());
}

}  // namespace
}  // namespace pirt::slam
