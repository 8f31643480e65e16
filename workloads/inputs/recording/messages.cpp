// @source  common_msgs of ROS: sensor_msgs, geometry_msgs; geometry2: tf2_msgs. The fields of ROS 2
// are the same in the same order, but for the head, which has no `seq` there.
#include "workloads/inputs/recording/messages.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "workloads/base/error.h"

namespace pirt {
namespace {

constexpr std::uint32_t kWidest = 20000;   // pixels, as of EuRoC's folders
constexpr double kUnknownCovariance = -1;  // in the first element: the field has no estimate

void write_head(WireWriter& out, const MessageHead& head) {
  if (out.format() == WireFormat::kRos1) out.u32(0);
  out.stamp(head.time);
  out.text(head.frame);
}

int side(WireReader& in) {
  const std::uint32_t pixels = in.u32();
  if (pixels > kWidest) in.fail("says that a picture is larger than 20000 pixels");
  return static_cast<int>(pixels);
}

/// @return  Whether it is measured, as its covariance says; else it need not be numbers.
bool read_measured(WireReader& in, Eigen::Vector3d& vector) {
  const auto v = in.numbers(3);
  vector = {v[0], v[1], v[2]};
  const bool is_measured = in.numbers(9)[0] != kUnknownCovariance;
  if (is_measured && !vector.allFinite()) in.fail("has a number that is not finite");
  return is_measured;
}

void write_vector(WireWriter& out, const Eigen::Vector3d& vector) {
  for (int i = 0; i < 3; ++i) out.f64(vector(i));
}

/// None where nobody has filled it.
std::optional<Pose> read_if_rigid(WireReader& in) {
  const auto p = in.numbers(3);
  const auto q = in.numbers(4);
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  Pose pose;
  pose.position = {p[0], p[1], p[2]};
  if (!pose.position.allFinite() || !(std::abs(rotation.norm() - 1.0) < 1e-3)) return std::nullopt;
  pose.rotation = rotation.normalized().toRotationMatrix();
  return pose;
}

Pose read_rigid(WireReader& in) {
  const auto pose = read_if_rigid(in);
  if (!pose) in.fail("has numbers that are not finite, or a quaternion whose length is not 1");
  return *pose;
}

void write_rigid(WireWriter& out, const Pose& pose) {
  write_vector(out, pose.position);
  for (const double part : quaternion_of(pose.rotation)) out.f64(part);
}

void write_zeros(WireWriter& out, int count, double first = 0) {
  for (int i = 0; i < count; ++i) out.f64(i == 0 ? first : 0);
}

// NOLINTBEGIN(bugprone-suspicious-missing-comma): parts of one text
#define PIRT_HEADER "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
#define PIRT_BAR \
  "================================================================================\n"
#define PIRT_VECTOR "float64 x\nfloat64 y\nfloat64 z\n"
#define PIRT_QUATERNION \
  "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
constexpr std::array kDefinitions = {
    MessageDefinition{ImageMessage::kType, "060021388200f6f0f447d0fcd9c64743",
                      "Header header\nuint32 height\nuint32 width\nstring encoding\n"
                      "uint8 is_bigendian\nuint32 step\nuint8[] data\n" PIRT_BAR PIRT_HEADER},
    MessageDefinition{ImageMessage::kCompressedType, "8f7a12909da2c9d3332d540a0977563f",
                      "Header header\nstring format\nuint8[] data\n" PIRT_BAR PIRT_HEADER},
    MessageDefinition{
        ImuMessage::kType, "6a62c6daae103f4ff57a132d6f95cec2",
        "Header header\ngeometry_msgs/Quaternion orientation\n"
        "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
        "float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n"
        "float64[9] linear_acceleration_covariance\n" PIRT_BAR PIRT_HEADER PIRT_BAR PIRT_QUATERNION
            PIRT_BAR "MSG: geometry_msgs/Vector3\n" PIRT_VECTOR},
    MessageDefinition{CameraInfoMessage::kType, "c9a58c1b0b154e0e6da7578cb991d214",
                      "Header header\nuint32 height\nuint32 width\nstring distortion_model\n"
                      "float64[] D\nfloat64[9] K\nfloat64[9] R\nfloat64[12] P\nuint32 binning_x\n"
                      "uint32 binning_y\nRegionOfInterest roi\n" PIRT_BAR PIRT_HEADER PIRT_BAR
                      "MSG: sensor_msgs/RegionOfInterest\nuint32 x_offset\nuint32 y_offset\n"
                      "uint32 height\nuint32 width\nbool do_rectify\n"},
    MessageDefinition{PoseMessage::kType, "d3812c3cbc69362b77dc0b19b345f8f5",
                      "Header header\nPose pose\n" PIRT_BAR PIRT_HEADER PIRT_BAR
                      "MSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation\n" PIRT_BAR
                      "MSG: geometry_msgs/Point\n" PIRT_VECTOR PIRT_BAR PIRT_QUATERNION},
    MessageDefinition{
        TransformMessage::kType, "94810edda583a504dfda3829e70d7eec",
        "geometry_msgs/TransformStamped[] transforms\n" PIRT_BAR
        "MSG: geometry_msgs/TransformStamped\nHeader header\nstring child_frame_id\n"
        "Transform transform\n" PIRT_BAR PIRT_HEADER PIRT_BAR
        "MSG: geometry_msgs/Transform\nVector3 translation\nQuaternion rotation\n" PIRT_BAR
        "MSG: geometry_msgs/Vector3\n" PIRT_VECTOR PIRT_BAR PIRT_QUATERNION}};
#undef PIRT_HEADER
#undef PIRT_VECTOR
#undef PIRT_QUATERNION
// NOLINTEND(bugprone-suspicious-missing-comma)

}  // namespace

Eigen::Vector4d quaternion_of(const Eigen::Matrix3d& rotation) {
  return Eigen::Quaterniond(rotation).coeffs();
}

MessageHead read_head(WireReader& in) {
  if (in.has_seq()) in.u32();
  MessageHead head;
  head.time = in.stamp();
  head.frame = in.text();
  return head;
}

ImageMessage read_image(WireReader& in, bool compressed) {
  ImageMessage message;
  message.head = read_head(in);
  message.compressed = compressed;
  if (!compressed) {
    message.height = side(in);
    message.width = side(in);
  }
  message.encoding = in.text();
  if (!compressed) {
    if (in.u8() != 0 && message.encoding.ends_with("16")) in.fail("has big-endian pixels");
    message.step = in.u32();
  }
  message.data = in.bytes();
  if (message.data.empty()) in.fail("has no pixels");
  if (!compressed &&
      message.data.size() < message.step * static_cast<std::size_t>(message.height)) {
    in.fail("has fewer pixels than it says");
  }
  return message;
}

ImuMessage read_imu(WireReader& in) {
  ImuMessage message;
  message.head = read_head(in);
  in.numbers(4 + 9);  // orientation, which a gyroscope does not know
  message.has_gyro = read_measured(in, message.gyro_rad_s);
  message.has_accel = read_measured(in, message.accel_m_s2);
  return message;
}

CameraInfoMessage read_camera_info(WireReader& in) {
  CameraInfoMessage message;
  message.head = read_head(in);
  message.height = side(in);
  message.width = side(in);
  message.distortion_model = in.text();
  message.d = in.numbers();
  message.k = in.numbers(9);
  message.r = in.numbers(9);
  message.p = in.numbers(12);
  for (int* each : {&message.binning_x, &message.binning_y, &message.roi_x, &message.roi_y,
                    &message.roi_height, &message.roi_width}) {
    *each = side(in);
  }
  return message;
}

PoseMessage read_pose(WireReader& in, std::string_view type) {
  PoseMessage message;
  message.head = read_head(in);
  if (type != PoseMessage::kType && type != PoseMessage::kWithCovariance) {
    message.child = in.text();
  }
  message.pose = read_rigid(in);
  return message;
}

std::vector<TransformMessage> read_transforms(WireReader& in) {
  std::vector<TransformMessage> messages;
  for (std::uint32_t left = in.count(); left > 0; --left) {
    TransformMessage message;
    message.head = read_head(in);
    message.child = in.text();
    if (const auto pose = read_if_rigid(in)) {
      message.parent_from_child = *pose;
      messages.push_back(std::move(message));
    }
  }
  return messages;
}

std::string written(const ImageMessage& message, WireFormat format) {
  WireWriter out(format);
  write_head(out, message.head);
  if (!message.compressed) {
    out.u32(static_cast<std::uint32_t>(message.height));
    out.u32(static_cast<std::uint32_t>(message.width));
  }
  out.text(message.encoding);
  if (!message.compressed) {
    out.u8(0);
    out.u32(static_cast<std::uint32_t>(message.step));
  }
  out.bytes(message.data);
  return out.written();
}

std::string written(const ImuMessage& message, WireFormat format) {
  WireWriter out(format);
  write_head(out, message.head);
  for (const double part : {0.0, 0.0, 0.0, 1.0}) out.f64(part);
  write_zeros(out, 9, kUnknownCovariance);
  write_vector(out, message.gyro_rad_s);
  write_zeros(out, 9, message.has_gyro ? 0 : kUnknownCovariance);
  write_vector(out, message.accel_m_s2);
  write_zeros(out, 9, message.has_accel ? 0 : kUnknownCovariance);
  return out.written();
}

std::string written(const CameraInfoMessage& message, WireFormat format) {
  WireWriter out(format);
  write_head(out, message.head);
  out.u32(static_cast<std::uint32_t>(message.height));
  out.u32(static_cast<std::uint32_t>(message.width));
  out.text(message.distortion_model);
  out.numbers(message.d);
  for (const double value : message.k) out.f64(value);
  for (int i = 0; i < 9; ++i) out.f64(i % 4 == 0 ? 1 : 0);
  for (const double value : message.p) out.f64(value);
  for (int i = 0; i < 6; ++i) out.u32(0);  // binning and region: all of it
  out.u8(0);
  return out.written();
}

std::string written(const PoseMessage& message, WireFormat format) {
  WireWriter out(format);
  write_head(out, message.head);
  write_rigid(out, message.pose);
  return out.written();
}

std::string written(const std::vector<TransformMessage>& messages, WireFormat format) {
  WireWriter out(format);
  out.u32(static_cast<std::uint32_t>(messages.size()));
  for (const TransformMessage& message : messages) {
    write_head(out, message.head);
    out.text(message.child);
    write_rigid(out, message.parent_from_child);
  }
  return out.written();
}

const MessageDefinition& definition_of(std::string_view type) {
  return *std::ranges::find(kDefinitions, type, &MessageDefinition::type);
}

std::string ros2_definition(std::string_view type) {
  std::string text(definition_of(type).text);
  const std::pair<std::string_view, std::string_view> changes[] = {
      {"\nuint32 seq\n", "\n"},
      {"Header header\n", "std_msgs/Header header\n"},
      {"\ntime stamp\n", "\nbuiltin_interfaces/Time stamp\n"},
      {"[] D\n", "[] d\n"},
      {"[9] K\n", "[9] k\n"},
      {"[9] R\n", "[9] r\n"},
      {"[12] P\n", "[12] p\n"}};
  for (const auto& [from, to] : changes) {
    for (auto at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size())) {
      text.replace(at, from.size(), to);
    }
  }
  return text + PIRT_BAR "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
}
#undef PIRT_BAR

}  // namespace pirt
