// A camera as its sensor_msgs/CameraInfo describes it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "workloads/base/geometry/camera.h"
#include "workloads/inputs/recording/messages.h"

namespace pirt {

struct InfoCamera {
  CameraModel model;
  /// From the axes of its frame of coordinates to those of rectified pictures.
  Eigen::Matrix3d rectified_from_raw = Eigen::Matrix3d::Identity();
  bool is_rectified = false;
  /// Of the camera that all are rectified to, along the axes of rectified pictures.
  double right_m = 0;

  [[nodiscard]] Eigen::Matrix3d picture_from_raw() const {
    return is_rectified ? rectified_from_raw : Eigen::Matrix3d::Identity();
  }
  /// Where the right camera's pictures are in this one's.
  [[nodiscard]] Pose pose_of(const InfoCamera& right) const;
};

/// @param in         Of the message, for errors.
/// @param rectified  Of which pictures: those of topics image_rect... have no lens and the focal
///                   length of P, others those of K and D.
/// @throws Error{kBadInput} for what is no calibration, and lenses that are not known.
/// @source sensor_msgs/CameraInfo.msg; binning and region as image_geometry takes them.
[[nodiscard]] InfoCamera camera_of(const WireReader& in, const CameraInfoMessage& message,
                                   bool rectified);

/// Whether P is of pictures of this size and K is not, so that they are rectified whatever their
/// topic is called, as kitti2bag's: K's centre is far from their middle and P's is not.
[[nodiscard]] bool seems_rectified(const CameraInfoMessage& message);

/// The rotation nearest to @p matrix; absent if that is none to 1e-3, or mirrors.
[[nodiscard]] std::optional<Eigen::Matrix3d> checked_rotation(const Eigen::Matrix3d& matrix);

/// Why these are no focal lengths and no centre of a picture; empty = they may be.
[[nodiscard]] std::string no_pinhole(const CameraModel& camera);
/// What can be, and seldom is: pixels that are no squares, a centre near an edge, a lens that bends
/// a corner out of all measure; empty = nothing.
[[nodiscard]] std::string odd_camera(const CameraModel& camera);

/// @param name   As CameraInfo has it: plumb_bob, rational_polynomial, equidistant.
/// @return       Empty, or why the camera cannot be used.
[[nodiscard]] std::string set_lens(CameraModel& camera, const std::string& name,
                                   std::vector<double> coefficients);

}  // namespace pirt
