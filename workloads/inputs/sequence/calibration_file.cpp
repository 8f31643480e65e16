#include "workloads/inputs/sequence/calibration_file.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/sequence/camera_info.h"
#include "workloads/inputs/sequence/sequence.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

/// Each row a list, as Kalibr writes them.
Pose rigid_of_rows(const YamlNode& node) {
  std::vector<double> numbers;
  for (const auto& row : node.items()) {
    for (const double each : numbers_of(row, 4, 4)) numbers.push_back(each);
  }
  if (numbers.size() != 16) node.fail("must be 4 rows of 4 numbers");
  return rigid_of(node, numbers);
}

/// Row by row. Of a camera that nobody has calibrated all are 0.
Eigen::Matrix3d rotation_of_nine(const YamlNode& node) {
  const auto rows = numbers_of(node, 9, 9);
  if (std::ranges::all_of(rows, [](double each) { return each == 0; })) {
    return Eigen::Matrix3d::Identity();
  }
  const auto rotation =
      checked_rotation(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data()));
  if (!rotation) node.fail("is no rotation");
  return *rotation;
}

/// @param k  fx, fy, cx, cy
void set_pinhole(CameraModel& model, const YamlNode& at, const std::vector<double>& k) {
  model.fx = k[0], model.fy = k[1], model.cx = k[2], model.cy = k[3];
  const std::string problem = no_pinhole(model);
  if (!problem.empty()) at.fail(problem);
}

constexpr std::int64_t kSmallestSide = 16, kLargestSide = 20000;

GivenCamera kalibr_camera(const YamlNode& node) {
  GivenCamera camera{.model = pinhole_camera(node)};
  std::string lens = node.has("distortion_model") ? node.at("distortion_model").text() : "none";
  if (lens == "radtan") lens = "plumb_bob";
  const bool has_lens = lens != "none" && node.has("distortion_coeffs");
  const std::string problem =
      set_lens(camera.model, lens,
               has_lens ? numbers_of(node.at("distortion_coeffs"), 0, 8) : std::vector<double>());
  if (!problem.empty()) node.fail(problem);
  if (node.has("rostopic")) camera.topic = node.at("rostopic").text();
  if (node.has("T_cam_imu")) {
    camera.body_from_camera = rigid_of_rows(node.at("T_cam_imu")).inverse();
  } else if (node.has("T_imu_cam")) {
    camera.body_from_camera = rigid_of_rows(node.at("T_imu_cam"));
  }
  if (node.has("timeshift_cam_imu")) {
    camera.imu_later_s = node.at("timeshift_cam_imu").number(-1, 1);
  }
  return camera;
}

/// All of a camchain, each with its place in the first one's axes: the file has it in those of the
/// camera before it.
std::vector<GivenCamera> kalibr_cameras(const YamlNode& root) {
  constexpr int kMost = 16;
  std::vector<GivenCamera> cameras;
  for (int i = 0; i < kMost; ++i) {
    const std::string name = fmt::format("cam{}", i);
    if (!root.has(name)) continue;
    const YamlNode node = root.at(name);
    GivenCamera camera = kalibr_camera(node);
    if (cameras.empty()) {
      camera.first_from_camera = Pose{};
    } else if (node.has("T_cn_cnm1") && cameras.back().first_from_camera) {
      camera.first_from_camera =
          *cameras.back().first_from_camera * rigid_of_rows(node.at("T_cn_cnm1")).inverse();
    }
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

GivenCamera ros_camera(const YamlNode& node) {
  GivenCamera camera;
  camera.model.width =
      static_cast<int>(node.at("image_width").integer(kSmallestSide, kLargestSide));
  camera.model.height =
      static_cast<int>(node.at("image_height").integer(kSmallestSide, kLargestSide));
  const auto k = numbers_of(node.at("camera_matrix").at("data"), 9, 9);
  set_pinhole(camera.model, node.at("camera_matrix"), {k[0], k[4], k[2], k[5]});
  const auto lens = numbers_of(node.at("distortion_coefficients").at("data"), 0, 14);
  // OpenCV's own file names no lens; it says whether it is the fisheye's.
  const bool is_fisheye = node.has("fisheye_model") && node.at("fisheye_model").text() != "0";
  const std::string name = node.has("distortion_model") ? node.at("distortion_model").text()
                           : is_fisheye                 ? "fisheye"
                           : lens.size() > 5            ? "rational_polynomial"
                                                        : "plumb_bob";
  const std::string problem = set_lens(camera.model, name, lens);
  if (!problem.empty()) node.at("distortion_coefficients").fail(problem);
  if (node.has("projection_matrix")) {
    const auto p = numbers_of(node.at("projection_matrix").at("data"), 12, 12);
    CameraModel& rectified = camera.rectified.emplace();
    rectified.width = camera.model.width;
    rectified.height = camera.model.height;
    set_pinhole(rectified, node.at("projection_matrix"), {p[0], p[5], p[2], p[6]});
    if (node.has("rectification_matrix")) {
      camera.rectified_from_raw = rotation_of_nine(node.at("rectification_matrix").at("data"));
    }
  }
  return camera;
}

GivenCamera euroc_camera(const fs::path& file) {
  GivenCamera camera{.model = read_camera_yaml(file)};
  camera.body_from_camera = camera.model.body_from_camera;
  const auto body_from_imu = imu_on_body(fs::absolute(file).parent_path().parent_path());
  if (body_from_imu) {
    camera.body_from_camera = body_from_imu->inverse() * *camera.body_from_camera;
  }
  return camera;
}

}  // namespace

YamlNode read_opencv_yaml(const fs::path& file) {
  std::string text = read_text(file);
  if (text.starts_with("%YAML:")) text.front() = '#';
  return parse_yaml(file.string(), text);
}

std::vector<double> numbers_of(const YamlNode& list, std::size_t least, std::size_t most,
                               double largest) {
  std::vector<double> values;
  for (const auto& item : list.items()) values.push_back(item.number(-largest, largest));
  if (values.size() < least || values.size() > most) {
    list.fail(fmt::format("must be a list of {} numbers", least));
  }
  return values;
}

CameraModel pinhole_camera(const YamlNode& node) {
  if (node.has("camera_model") && node.at("camera_model").text() != "pinhole") {
    node.at("camera_model").fail("only pinhole is known");
  }
  CameraModel camera;
  const auto size = node.at("resolution").items();
  if (size.size() != 2) node.at("resolution").fail("must be [width, height]");
  camera.width = static_cast<int>(size[0].integer(kSmallestSide, kLargestSide));
  camera.height = static_cast<int>(size[1].integer(kSmallestSide, kLargestSide));
  set_pinhole(camera, node.at("intrinsics"), numbers_of(node.at("intrinsics"), 4, 4));
  return camera;
}

Pose rigid_of(const YamlNode& node, const std::vector<double>& rows) {
  constexpr double kLongest_m = 5;  // a rig of millimetres has hundreds
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(rows.data());
  const auto rotation = checked_rotation(matrix.topLeftCorner<3, 3>());
  if (!rotation) {
    node.fail("the left 3x3 numbers are no rotation (row-major, orthonormal, determinant 1)");
  }
  const Pose pose{*rotation, matrix.topRightCorner<3, 1>()};
  if (pose.position.norm() > kLongest_m) {
    node.fail(fmt::format("the sensor is {:.1f} m from the body; are these millimetres?",
                          pose.position.norm()));
  }
  return pose;
}

Pose extrinsics_of(const YamlNode& sensor) {
  const YamlNode node = sensor.at("T_BS").at("data");
  return rigid_of(node, numbers_of(node, 16, 16));
}

std::optional<Pose> imu_on_body(const fs::path& root) {
  const fs::path file = root / "imu0" / "sensor.yaml";
  std::error_code failed;
  if (!fs::exists(file, failed)) return std::nullopt;
  const YamlNode sensor = read_opencv_yaml(file);
  return sensor.has("T_BS") ? std::optional(extrinsics_of(sensor)) : std::nullopt;
}

std::vector<GivenCamera> read_calibration(const fs::path& path) {
  std::error_code failed;
  std::vector<GivenCamera> cameras;
  if (fs::is_directory(path, failed)) {
    const fs::path root = fs::exists(path / "mav0", failed) ? path / "mav0" : path;
    for (const char* name : {"cam0", "cam1"}) {
      const fs::path file = root / name / "sensor.yaml";
      if (!fs::exists(file, failed)) continue;
      cameras.push_back(euroc_camera(file));
      cameras.back().topic = fmt::format("/{}/image_raw", name);
    }
    if (!cameras.empty()) return cameras;
    throw_bad_input("'" + path.string() + "' has no cam0/sensor.yaml, which is a calibration");
  }
  const YamlNode root = read_opencv_yaml(path);
  if (root.has("camera_matrix")) return {ros_camera(root)};
  if (root.has("intrinsics")) return {euroc_camera(path)};
  cameras = kalibr_cameras(root);
  if (cameras.empty()) {
    root.fail("is no calibration: Kalibr's has cam0, EuRoC's intrinsics, ROS's camera_matrix");
  }
  return cameras;
}

}  // namespace pirt
