// Calibrations of cameras in files of their own, for recordings that have no CameraInfo.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "workloads/base/geometry/camera.h"
#include "workloads/base/text/yaml.h"

namespace pirt {

struct GivenCamera {
  CameraModel model;
  std::string topic = {};  ///< Of its pictures; empty = the file does not say.
  /// Where it sits, with the IMU as body; absent = the file does not say.
  std::optional<Pose> body_from_camera = {},
                      first_from_camera = {};  ///< First: the file's first camera.
  std::optional<CameraModel> rectified = {};   ///< What its rectified pictures are of.
  /// From its axes to theirs.
  Eigen::Matrix3d rectified_from_raw = Eigen::Matrix3d::Identity();
  double imu_later_s = 0;  ///< What the IMU's stamps of a moment are more than its own.
};

/// @param path  Kalibr's camchain (cam0, cam1, ..., also with T_cam_imu, or OpenVINS' T_imu_cam),
///              EuRoC's sensor.yaml or the folder of cam0/sensor.yaml and cam1/sensor.yaml, of
///              topics /cam0/image_raw and /cam1/image_raw, with the IMU as body where
///              imu0/sensor.yaml is in the same folder, or what ROS's camera_calibration or
///              OpenCV's own writes (camera_matrix).
/// @throws Error{kBadInput} with file:line.
[[nodiscard]] std::vector<GivenCamera> read_calibration(const std::filesystem::path& path);

/// OpenCV writes "%YAML:1.0", which is no YAML directive.
[[nodiscard]] YamlNode read_opencv_yaml(const std::filesystem::path& file);
/// Of a list of @p least to @p most numbers, each of up to @p largest.
[[nodiscard]] std::vector<double> numbers_of(const YamlNode& list, std::size_t least,
                                             std::size_t most, double largest = 1e6);
/// Size of the pictures, focal lengths and centre, as Kalibr and EuRoC write them.
[[nodiscard]] CameraModel pinhole_camera(const YamlNode& node);
/// Of a sensor. @param rows  4 of 4 numbers, one after the other; of @p node, for errors.
[[nodiscard]] Pose rigid_of(const YamlNode& node, const std::vector<double>& rows);
/// EuRoC's T_BS: where a sensor sits on the body.
[[nodiscard]] Pose extrinsics_of(const YamlNode& sensor);
/// As imu0/sensor.yaml of a folder of EuRoC's layout has it, if it is there and says so.
[[nodiscard]] std::optional<Pose> imu_on_body(const std::filesystem::path& root);

}  // namespace pirt
