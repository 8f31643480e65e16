// Bundle adjustment problems whose answer is known: a camera that goes round a scene.
#pragma once

#include <cstdint>
#include <vector>

#include "workloads/mapping/bal.h"

namespace pirt::mapping {

inline constexpr int kLeastImages = 8;
inline constexpr int kMostImages = 10'000;
inline constexpr int kMostPoints = 10'000'000;
/// In how many images each point is seen.
inline constexpr int kShortestTrack = 4;
inline constexpr int kLongestTrack = 15;

struct BalParameters {
  int images = 100;   ///< kLeastImages to kMostImages.
  int points = 5000;  ///< 1 to kMostPoints.
  double noise_px = 1;
  double outliers = 0;  ///< The part of observations that are anywhere in the image, 0 to 0.5.
  std::uint64_t seed = 1;
};

struct GeneratedBal {
  BalProblem problem;                 ///< Cameras and points as a first guess has them.
  BalProblem truth;                   ///< As they are, with observations without noise or outliers.
  std::vector<std::size_t> outliers;  ///< Observations, in rising order.
};

/// 640x480 images of 500 px focal length, a little barrel distortion, from a ring of 5 m radius,
/// looking inwards at points in 5x5x3 m; each point is seen in 4 to 15 images in a row of those
/// that have it in view. The first guess is off by 0.5 degree and 3 cm a camera, 1 % of the focal
/// length and 10 cm a point (standard deviations). The same parameters give the same bits.
[[nodiscard]] GeneratedBal generate_bal(const BalParameters& parameters);

}  // namespace pirt::mapping
