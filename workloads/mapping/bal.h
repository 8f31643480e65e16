// Bundle adjustment problems and their files, in the format of "Bundle Adjustment in the Large".
//
// @source https://grail.cs.washington.edu/projects/bal; Agarwal, Snavely, Seitz, Szeliski, ECCV
// 2010
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace pirt::mapping {

/// A point of the map as one image has it.
struct Observation {
  std::int32_t camera = 0;
  std::int32_t point = 0;
  double x = 0;  ///< Pixels from the image's centre, to the right,
  double y = 0;  ///< and up.
};

/// Of one image: an angle-axis rotation R, a translation t, the focal length f in pixels, and the
/// radial distortion k1, k2. A point X of the map is at P = R X + t in its frame, which looks along
/// -z; with p = -(Px, Py) / Pz its pixel is f (1 + k1 |p|^2 + k2 |p|^4) p.
inline constexpr std::size_t kCameraSize = 9;
inline constexpr std::size_t kPointSize = 3;

struct BalProblem {
  std::vector<Observation> observations;
  std::vector<double> cameras;  ///< [cameras, 9]: R (3), t (3), f, k1, k2.
  std::vector<double> points;   ///< [points, 3]

  [[nodiscard]] std::size_t camera_count() const { return cameras.size() / kCameraSize; }
  [[nodiscard]] std::size_t point_count() const { return points.size() / kPointSize; }
};

/// @throws Error{kBadInput} "file:line: ..." for an index out of range, what is no finite number,
/// or a file that ends too soon or has more than its first line says.
[[nodiscard]] BalProblem read_bal(const std::filesystem::path& file);

/// The text of a file, which read_bal() reads to the same bits.
[[nodiscard]] std::string bal_text(const BalProblem& problem);

/// Where the point of @p observation is predicted to be minus where it was seen, in pixels, x and y
/// of each observation in their order. Not finite for a point in the plane of its camera.
[[nodiscard]] std::vector<double> residuals_px(const BalProblem& problem);
/// Half the sum of their squares: what an adjustment makes small.
[[nodiscard]] double half_squares(std::span<const double> residuals);

}  // namespace pirt::mapping
