// The messages of ROS that sequences are read from and written to. What they have besides is read
// over and written as "not known".
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/base/geometry/geometry.h"
#include "workloads/base/time.h"
#include "workloads/inputs/recording/wire.h"

namespace pirt {

struct MessageHead {
  Nanos time{};
  std::string frame;  ///< Of coordinates: "cam0".
};

/// sensor_msgs/Image, or sensor_msgs/CompressedImage, whose data is a PNG or JPEG file.
struct ImageMessage {
  static constexpr std::string_view kType = "sensor_msgs/Image";
  static constexpr std::string_view kCompressedType = "sensor_msgs/CompressedImage";
  MessageHead head;
  bool compressed = false;
  int width = 0, height = 0;  ///< Of what is not compressed.
  std::string encoding;       ///< "mono8"; of what is compressed, "png".
  std::size_t step = 0;       ///< Bytes a row.
  std::string_view data;      ///< Refers to the message.
};

struct ImuMessage {
  static constexpr std::string_view kType = "sensor_msgs/Imu";
  MessageHead head;
  Eigen::Vector3d gyro_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_m_s2 = Eigen::Vector3d::Zero();
  /// Their covariances say so; what is not there need not be numbers.
  bool has_gyro = true, has_accel = true;
};

struct CameraInfoMessage {
  static constexpr std::string_view kType = "sensor_msgs/CameraInfo";
  MessageHead head;
  int width = 0, height = 0;
  std::string distortion_model;
  std::vector<double> d, k, p;  ///< Lens; 3x3 and 3x4, row-major.
  std::vector<double> r = {};   ///< 3x3: from the camera's axes to those of rectified pictures.
  int binning_x = 0, binning_y = 0;                         ///< 0 = none, as 1.
  int roi_x = 0, roi_y = 0, roi_height = 0, roi_width = 0;  ///< Before binning; 0 = all of it.
};

struct PoseMessage {
  static constexpr std::string_view kType = "geometry_msgs/PoseStamped";
  static constexpr std::string_view kWithCovariance = "geometry_msgs/PoseWithCovarianceStamped";
  static constexpr std::string_view kOdometry = "nav_msgs/Odometry";
  static constexpr std::string_view kTransform = "geometry_msgs/TransformStamped";
  MessageHead head;
  std::string child = {};  ///< Whose pose it is, where the type says it.
  Pose pose;
};

/// A tf2_msgs/TFMessage is a list of these.
struct TransformMessage {
  static constexpr std::string_view kType = "tf2_msgs/TFMessage";
  /// Before tf2; the same bytes.
  static constexpr std::string_view kOldType = "tf/tfMessage";
  MessageHead head;  ///< Its frame is the parent.
  std::string child;
  Pose parent_from_child;
};

/// x, y, z, w.
[[nodiscard]] Eigen::Vector4d quaternion_of(const Eigen::Matrix3d& rotation);

/// With which all but TransformMessage begin.
[[nodiscard]] MessageHead read_head(WireReader& in);
[[nodiscard]] ImageMessage read_image(WireReader& in, bool compressed);
[[nodiscard]] ImuMessage read_imu(WireReader& in);
[[nodiscard]] CameraInfoMessage read_camera_info(WireReader& in);
/// @param type  One of PoseMessage's.
[[nodiscard]] PoseMessage read_pose(WireReader& in, std::string_view type = PoseMessage::kType);
/// Without those that are none, which nobody has filled.
[[nodiscard]] std::vector<TransformMessage> read_transforms(WireReader& in);

[[nodiscard]] std::string written(const ImageMessage& message, WireFormat format);
[[nodiscard]] std::string written(const ImuMessage& message, WireFormat format);
[[nodiscard]] std::string written(const CameraInfoMessage& message, WireFormat format);
[[nodiscard]] std::string written(const PoseMessage& message, WireFormat format);
[[nodiscard]] std::string written(const std::vector<TransformMessage>& messages, WireFormat format);

/// What a bag of ROS 1 says of a type besides its name.
struct MessageDefinition {
  std::string_view type, md5, text;
};
/// @param type  One of the kType above.
[[nodiscard]] const MessageDefinition& definition_of(std::string_view type);
/// The text of the same type in ROS 2.
[[nodiscard]] std::string ros2_definition(std::string_view type);

}  // namespace pirt
