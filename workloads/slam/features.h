// Corners with binary descriptors: what a place looks like, so that it is known again.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "workloads/sequence/camera.h"

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

}  // namespace pirt::slam
