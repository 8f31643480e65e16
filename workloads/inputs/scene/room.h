// A textured room with furniture, and what a camera in it sees.
//
// Light is constant and surfaces are matt: what is tested is geometry, not exposure control.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "workloads/base/geometry/camera.h"
#include "workloads/base/geometry/geometry.h"
#include "workloads/model/grey_image.h"

namespace pirt {

struct Box {
  Eigen::Vector3d low, high;
};

/// 8 x 8 x 4 m, a corner at the origin; the middle ring, 1.2 to 3.1 m from its centre, is free.
inline constexpr double kRoomSide_m = 8.0;
inline constexpr double kRoomHeight_m = 4.0;

/// A square ring, 25 m a side outside and 3 m high, a corner at the origin: what a robot sees first
/// is behind it until it has been all around.
inline constexpr double kCorridorSide_m = 25.0;
inline constexpr double kCorridorWidth_m = 2.6;
inline constexpr double kCorridorHeight_m = 3.0;

enum class RoomKind : std::uint8_t { kRoom, kCorridor };
[[nodiscard]] inline Eigen::Vector3d size_of(RoomKind kind) {
  return kind == RoomKind::kRoom
             ? Eigen::Vector3d(kRoomSide_m, kRoomSide_m, kRoomHeight_m)
             : Eigen::Vector3d(kCorridorSide_m, kCorridorSide_m, kCorridorHeight_m);
}

/// Grey levels on a rectangle in space, with coarser copies of itself.
struct Face {
  Eigen::Vector3d origin;         ///< Of texel (0, 0).
  Eigen::Vector3d u, v, n;        ///< Unit vectors along columns, rows, and the plane's normal.
  std::vector<GreyImage> levels;  ///< Each half of the one before.
};

/// Immutable; any thread may use it.
class Room {
 public:
  /// Furniture and textures are a function of @p seed.
  explicit Room(std::uint64_t seed, RoomKind kind = RoomKind::kRoom);
  [[nodiscard]] const std::vector<Box>& furniture() const { return furniture_; }
  [[nodiscard]] const std::vector<Face>& faces() const { return faces_; }
  /// The face that a ray from within the room meets first.
  [[nodiscard]] int face_seen(const Eigen::Vector3f& from, const Eigen::Vector3f& direction) const;

 private:
  Eigen::Vector3d size_;
  std::vector<Box> furniture_;
  std::vector<Face> faces_;  ///< 6 of the room, then 6 a box: low x, high x, low y, ...
};

inline constexpr double kTexelsPerMetre = 128.0;

/// A camera with its rays, so that each picture does not find them again. Immutable.
class RoomCamera {
 public:
  RoomCamera(const Room& room, const CameraModel& camera);
  /// Mean of what is seen from each of @p poses (camera -> world): motion blur. No noise.
  [[nodiscard]] GreyImage picture(std::span<const Pose> poses) const;

 private:
  struct Homography;
  [[nodiscard]] Homography homography(const Face& face, const Pose& pose) const;
  void find_faces(const Pose& pose, std::vector<std::int16_t>& faces) const;

  const Room* room_;
  CameraModel camera_;
  std::vector<float> x_, y_;  ///< Of each pixel's ray (x, y, 1), row-major.
};

/// Adds Gaussian noise of @p sigma grey levels, a function of @p seed.
void add_noise(GreyImage& image, double sigma, std::uint64_t seed);

}  // namespace pirt
