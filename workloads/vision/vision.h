// The vision workloads of Table I: operation records and specs. One exact definition each, so that
// every backend computes the same function; the integer ones are defined to the last bit. The
// definitions in words stand beside each make_ function; the code that defines them is `reference`
// in the .cpp of the same name.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "workloads/model/workload.h"

namespace pirt::vision {

struct ImageOperation : Operation {
  int width = 0;   ///< Pixels, >= 1.
  int height = 0;  ///< Pixels, >= 1.
};

struct GaussianBlur : ImageOperation {};

/// Kernel "filter7x7": integer weights over 2^shift, see make_convolution.
struct Filter7x7 : ImageOperation {
  static constexpr int kSize = 7;
  static constexpr int kShift = 8;
};

struct Sobel : ImageOperation {};

/// Pinhole camera with radial-tangential distortion, all in pixels of the distorted image.
struct Camera {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0;
};

struct Undistort : ImageOperation {
  Camera camera;
};

struct FeatureDetect : ImageOperation {
  static constexpr int kMaxCorners = 500;
  static constexpr double kQuality = 0.01;
  static constexpr int kMinDistance = 10;  ///< Pixels.
  static constexpr int kBlock = 3;
};

struct OpticalFlow : ImageOperation {
  static constexpr int kWindow = 52;  ///< Rows y-26 .. y+25, columns alike.
};

struct ExtractFeatures : ImageOperation {
  static constexpr int kMost = 400;
  static constexpr int kCell = 32;       ///< Pixels; a cell has its share of the features.
  static constexpr int kThreshold = 12;  ///< Of FAST, in grey levels.
};

struct TrackFeatures : ImageOperation {
  static constexpr int kMaxPoints = FeatureDetect::kMaxCorners;
  static constexpr int kLevels = 4;
  static constexpr int kRadius = 7;  ///< The window is 15x15.

  struct Level {
    int width, height;
  };
  /// The finest first.
  [[nodiscard]] std::array<Level, kLevels> levels() const;
};

struct BackgroundModel : ImageOperation {
  static constexpr int kThreshold = 24;  ///< Grey levels.
  static constexpr int kMaxShift = 4;    ///< The slowest rate is 1/2^4.
};

/// 5x5 binomial [1 4 6 4 1]^2/256 (what OpenCV takes for 5x5 and sigma <= 0), border reflect-101,
/// (sum + 128) >> 8. Kernel "gaussian_blur". Input u8 [h,w], output u8 [h,w].
Workload make_gaussian_blur(int width, int height);

/// Correlation with a general 7x7 kernel of integers, border reflect-101:
/// saturate_u8(round_half_even(sum / 2^8)). Kernel "filter7x7". Input u8 [h,w], parameter weights
/// i16 [7,7] (seeded, |w| <= 127, not separable, sum about 2^8), output u8 [h,w].
Workload make_convolution(int width, int height);

/// 3x3 Sobel, Gx and Gy, border reflect-101, exact. Kernel "sobel". Input u8 [h,w], outputs gx i16
/// [h,w], gy i16 [h,w].
Workload make_sobel(int width, int height);

/// Undistortion by a map made once in `prepare`: for each output pixel the source position in 1/32
/// pixel (round half even of 32*u), then bilinear with weights (32-fx)(32-fy)..., (sum + 512) >>
/// 10, 0 outside the image (as remap with a constant border does: each of the four neighbours
/// outside counts as 0). Kernel "undistort". Input u8 [h,w], output u8 [h,w].
Workload make_undistort(int width, int height);

/// Source position of one output pixel in 1/32 pixel: x = floor-free integer 32*u, so that column =
/// x >> 5 and fraction = x & 31.
struct MapEntry {
  std::int32_t x = 0;
  std::int32_t y = 0;
};
/// The map of make_undistort, row-major [h,w]; the same camera matrix before and after. In double
/// precision.
[[nodiscard]] std::vector<MapEntry> undistort_map(const Undistort& operation);
/// What make_undistort defines, for any camera: @p image and result u8 [h,w].
[[nodiscard]] std::vector<std::uint8_t> undistorted(const Undistort& operation,
                                                    std::span<const std::uint8_t> image);

/// GoodFeaturesToTrack (Shi-Tomasi) as OpenCV has it: Sobel 3x3 gradients with border reflect-101,
/// products summed over a 3x3 block with border reflect-101, smaller eigenvalue, threshold at
/// quality * maximum, 3x3 local maxima (border pixels of the image excluded), strongest first
/// (ties: the later in memory first, as OpenCV sorts), at least 10 pixels from every stronger
/// accepted corner, at most 500. Kernel "feature_detect". Input u8 [h,w], output the list corners
/// f32 [<=500,2] (x, y). Verified as sets: float rounding of near ties may move a few; see the
/// tolerance in the .cpp.
Workload make_feature_detect(int width, int height);

/// Dense, single-level, non-iterative Lucas-Kanade. With border replicate: dx = I0(x+1) - I0(x-1),
/// dy alike, dt = I1 - I0 (integers; dx and dy are twice the central difference). Sums of dx*dx,
/// dx*dy, dy*dy, dx*dt, dy*dt over rows y-26..y+25 and columns x-26..x+25, the products replicated
/// beyond the border. det = Sxx*Syy - Sxy^2 in exact 64-bit integers; flow 0 where det == 0,
/// otherwise u = 2*(Sxy*Syt - Syy*Sxt)/det, v = 2*(Sxy*Sxt - Sxx*Syt)/det, in pixels per frame.
/// Kernel "optical_flow". Inputs previous u8 [h,w], next u8 [h,w]; output flow f32 [h,w,2].
Workload make_optical_flow(int width, int height);

/// What slam::extract_features gives (slam/features.h), by its rules: pixels where 9 neighbours in
/// a row of the 16 on a circle of radius 3 are all brighter or all darker by more than kThreshold,
/// and by more than at each of the 8 pixels beside it; the best of each cell by the smaller
/// eigenvalue of the sums of central differences' products over 7x7; the pixel is then the centre
/// of the gradients' energy over 15x15, in 3 steps; 256 comparisons of the picture under
/// slam::kFeatureBlur. None within 20 pixels of the rim. Kernel "extract_features". Input u8 [h,w],
/// outputs the lists pixels f32 [<=400,2] (x, y), scores f32 [<=400] and descriptors u8
/// [<=400,32], strongest first.
Workload make_extract_features(int width, int height);

/// What slam::track_features gives (pyramid.h), by its rules, where a point is its own guess: what
/// a robot follows its points with. Pyramids of kLevels levels, each the one below under
/// [1 2 1]^2/16 and every second pixel. From the coarsest to the finest: a window of 15x15 samples
/// of `previous`, bilinear, with central differences and without their means; steps of Lucas-Kanade
/// until one is shorter than 0.01 pixels, 12 at most, with the windows' difference in brightness
/// taken out. A level that says too little is left out, but for the finest. What does not look
/// alike, or does not come back to within 0.8 pixels when it is followed back, is lost (status 0);
/// its track is then the point itself. Kernel "track_features". Inputs previous u8 [h,w], next u8
/// [h,w], list corners f32 [<=500,2]; outputs tracks f32 [<=500,2] and status u8 [<=500], as many
/// rows as corners. Measured with a sequence of 4 pairs and corners of the first of each, of which
/// each pair has fewer, as a tracker loses them. Its operations are those of the points' own steps.
Workload make_track_features(int width, int height);

/// Exponential background of a picture's pixels, and what differs from it. With b the state's
/// background and n its frames: d = image - b; mask = 255 where n > 0 and |d| > 24, otherwise 0;
/// b += d / 2^n; n = min(n + 1, 4). So that the first picture is the background, then the mean of
/// two, and later ones count 1/16. In f32: the subtraction and the sum round, the product is exact,
/// so that every way to compute it gives the same bits. Kernel "background_model". Input u8 [h,w],
/// output mask u8 [h,w], state "background": background f32 [h,w], frames i32 [1], all 0 at first.
/// Measured with a sequence of 8 pictures.
Workload make_background_model(int width, int height);

// All of them, also those whose definition stands in their own file.
#define PIRT_VISION(name, width, height) Workload make_##name(int, int);
#include "workloads/vision/workloads.inc"

/// One of the vision workloads.
struct Entry {
  Workload (*make)(int width, int height);
  int width, height;  ///< Of the catalog.
  bool in_table1;
};
[[nodiscard]] std::vector<Entry> entries();

/// All of them as the catalog has them.
[[nodiscard]] std::vector<Workload> all();

}  // namespace pirt::vision
