// Corners with binary descriptors: what a place looks like, so that it is known again.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "workloads/model/grey_image.h"

namespace pirt::slam {

/// 256 comparisons of brightness, a bit each. Upright: a view that is turned about its axis by more
/// than some 20 degrees is another one.
using Descriptor = std::array<std::uint8_t, 32>;

/// Bits that differ, 0 to 256.
[[nodiscard]] int distance(const Descriptor& a, const Descriptor& b);

struct Features {
  std::vector<Eigen::Vector2f> pixels;  ///< f32 [n,2], to a fraction of a pixel.
  std::vector<float> scores;            ///< Least eigenvalue of the gradients' matrix.
  std::vector<Descriptor> descriptors;  ///< u8 [n,32]
};

struct FeatureOptions {
  int most = 400;
  int cell = 32;       ///< Pixels; the picture's cells share the features evenly.
  int threshold = 12;  ///< Of FAST, in grey levels.
};

/// FAST corners (Rosten and Drummond, 2006), the best of each cell by Shi and Tomasi's score over
/// 7x7, strongest first, with BRIEF descriptors (Calonder et al., 2010) on a blurred picture. None
/// within 20 pixels of the picture's rim.
[[nodiscard]] Features extract_features(const GreyImage& image, const FeatureOptions& options);

// The parts of it, for whoever computes the others in another way (workload extract_features).

inline constexpr int kFeatureRim = 20;        ///< Pixels: of the descriptor's patch and the blur.
inline constexpr int kFeatureScoreHalf = 3;   ///< The score's window is 7x7.
inline constexpr int kFeatureWindowHalf = 7;  ///< That which is followed is 15x15.
inline constexpr int kFeatureRefineSteps = 3;
inline constexpr float kFeatureFarthest = 4.0F;  ///< Pixels by which refining may move a corner.
/// Of the blur before brightness is compared: 256 times a Gaussian of sigma 2, with what rounding
/// leaves carried on towards the middle, as OpenCV has it. The sum of both
/// directions is divided by 2^16 and rounded, halves up.
inline constexpr std::array<int, 7> kFeatureBlur = {18, 34, 48, 56, 48, 34, 18};

/// FAST's circle: x and y from its middle, in order.
inline constexpr std::array<std::pair<int, int>, 16> kFastCircle = {{{0, 3},
                                                                     {1, 3},
                                                                     {2, 2},
                                                                     {3, 1},
                                                                     {3, 0},
                                                                     {3, -1},
                                                                     {2, -2},
                                                                     {1, -3},
                                                                     {0, -3},
                                                                     {-1, -3},
                                                                     {-2, -2},
                                                                     {-3, -1},
                                                                     {-3, 0},
                                                                     {-3, 1},
                                                                     {-2, 2},
                                                                     {-1, 3}}};

struct FastCorner {
  int x = 0, y = 0;
  float score = 0;  ///< Shi and Tomasi's.
};

/// Pixels whose contrast is more than @p threshold and than that of each of their 8 neighbours, by
/// rows, without scores; the contrast is by how much the arc of 9 pixels of the circle that differs
/// most, brighter or darker, does so at least. They are cv::FAST's; all pixels of a vector are
/// judged at once, without a branch.
/// @param threshold  Grey levels.
[[nodiscard]] std::vector<FastCorner> fast_corners(const GreyImage& image, int threshold);

/// The smaller eigenvalue of [xx xy; xy yy], the sums of the gradients' products.
[[nodiscard]] float corner_score(int xx, int xy, int yy);

/// The best corners of each cell, strongest first; where they are equal, by rows.
/// @param found  In any order, within a picture of @p width x @p height.
[[nodiscard]] std::vector<FastCorner> best_corners(std::span<const FastCorner> found, int width,
                                                   int height, const FeatureOptions& options);

/// One comparison of a descriptor: its bit is 1 where a is darker than b. Offsets in pixels from
/// the corner, at most 15.
struct PatchPair {
  std::int8_t ax = 0, ay = 0, bx = 0, by = 0;
};
[[nodiscard]] std::span<const PatchPair, 256> descriptor_pattern();

}  // namespace pirt::slam
