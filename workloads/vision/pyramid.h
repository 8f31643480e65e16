// Following points from one picture to the next: sparse pyramidal Lucas-Kanade.
//
// One function from pictures and points to points; no state. Each point is independent of the
// others, so that any split over threads or devices gives the same bits.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "workloads/model/grey_image.h"

namespace pirt::slam {

/// A picture and halves of it: levels[k] has 1/2^k of the extent.
struct Pyramid {
  std::vector<GreyImage> levels;
  [[nodiscard]] bool empty() const { return levels.empty(); }
};

inline constexpr int kPyramidLevels = 4;
/// Each level is the one before under [1 2 1]^2/16, every second pixel; edges repeat.
[[nodiscard]] Pyramid make_pyramid(GreyImage image, int levels = kPyramidLevels);

struct TrackOptions {
  int iterations = 12;        ///< Most a level.
  double enough = 0.01;       ///< Step in pixels that ends them.
  double most_error = 14.0;   ///< Mean absolute difference, in grey levels, of what is found.
  double least_corner = 4.0;  ///< Least eigenvalue of the gradients' matrix, a pixel.
  double back = 0.8;          ///< Pixels from where it came, followed back; 0 = not followed back.
};

struct TrackedPoint {
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
  bool found = false;
};

/// What following points took.
struct TrackWork {
  std::int64_t windows = 0;  ///< That were taken of a picture, with their gradients.
  std::int64_t steps = 0;    ///< Of all windows, levels and directions.
  std::int64_t looks = 0;    ///< Whether what was found looks alike, and how it has deformed.
};

/// @param from, to  Of pictures of one size.
/// @param points    Pixels in @p from, f32 [n,2].
/// @param guesses   Where they may be in @p to, f32 [n,2].
/// @return          [n]; not found where a window of 15x15 comes within a pixel of the left or
/// upper
///                  rim, 6 of the right or 3 of the lower one, has no corner, or does not look
///                  alike.
/// @source  Bouguet, Pyramidal implementation of the Lucas Kanade feature tracker, 2001. A constant
/// difference in brightness over the window is taken out. In the end the window may have deformed,
/// affinely: one step more finds that beside the motion of its middle (Shi and Tomasi, Good
/// features to track, 1994), which does not slide over the scene as the best fit of all of it does.
[[nodiscard]] std::vector<TrackedPoint> track_features(const Pyramid& from, const Pyramid& to,
                                                       std::span<const Eigen::Vector2f> points,
                                                       std::span<const Eigen::Vector2f> guesses,
                                                       const TrackOptions& options);
/// The same, of one point.
[[nodiscard]] TrackedPoint track_feature(const Pyramid& from, const Pyramid& to,
                                         const Eigen::Vector2f& point, const Eigen::Vector2f& guess,
                                         const TrackOptions& options, TrackWork* work = nullptr);

}  // namespace pirt::slam
