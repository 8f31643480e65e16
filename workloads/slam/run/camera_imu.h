// Whether a sequence's pictures and its IMU belong together: their clocks, how the camera is turned
// in the body, and which way accelerations point. The filter takes all of it as given, and
// localizes worse where it is wrong.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "workloads/inputs/sequence/sequence.h"

namespace pirt::slam {

/// What the turns of the left camera, picture to picture, say beside those of the gyroscope.
struct CameraImuFit {
  double late_s = 0;   ///< By how much pictures' stamps are later than those of the IMU.
  double sigma_s = 0;  ///< Of it.
  Eigen::Vector3d tilt_rad =
      Eigen::Vector3d::Zero();  ///< By which the calibration turns the camera too far, body axes.
  double tilt_sigma_rad = 0;    ///< An axis.
  std::size_t pairs = 0;        ///< Of pictures.
};

/// Reads some 100 pictures from where the body turns most differently; lateness is looked for
/// within 60 ms. What is not looked at: where the camera sits in the body, which turns do not tell.
/// @return  Absent without an IMU, or where it turns too little to tell what is found, or 5 ms.
/// @throws  Error as Sequence::image.
/// @source  Furgale, Rehder and Siegwart, Unified temporal and spatial calibration for multi-sensor
/// systems, IROS 2013, which fits both to turns alone, too.
[[nodiscard]] std::optional<CameraImuFit> fit_camera_to_imu(const Sequence& sequence);

/// What a user should know of it: lateness of more than 5 ms, a tilt of more than a degree, where
/// they are no chance.
[[nodiscard]] std::vector<std::string> warnings_of(const CameraImuFit& fit);

/// How an IMU and the pictures say that the body moves: 1 = alike, 0 = one has nothing to do with
/// the other, -1 = opposite. Absent where it moves too little to tell.
struct ImuAlike {
  std::optional<double> turns;  ///< Of the gyroscope.
  /// Opposite where a device says which way gravity pulls, not what holds the body against it. At
  /// rest nothing tells: the body may hang upside down.
  std::optional<double> accelerations;
  double turn_ratio = 1;  ///< How far pictures turn, to how far the gyroscope does.
};

/// Localizes some 100 pictures from where accelerations change most, without the IMU.
/// @throws Error as Sequence::image.
[[nodiscard]] ImuAlike compare_imu(const Sequence& sequence);

/// What a user should know of it.
/// @throws Error{kBadInput} if one of them is opposite, or turns in degrees: a path by it would
/// look like one.
[[nodiscard]] std::vector<std::string> warnings_of(const ImuAlike& alike, const Sequence& sequence);

}  // namespace pirt::slam
