#include "workloads/inputs/sequence/camera_info.h"

#include <fmt/core.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace pirt {
namespace {

Eigen::Matrix3d rotation_in(const WireReader& in, const std::vector<double>& rows) {
  if (std::ranges::all_of(rows, [](double each) { return each == 0; })) {
    return Eigen::Matrix3d::Identity();  // nobody has calibrated it
  }
  Eigen::Matrix3d rotation;
  for (Eigen::Index i = 0; i < 9; ++i) rotation(i / 3, i % 3) = rows[static_cast<std::size_t>(i)];
  const auto checked = checked_rotation(rotation);
  if (!checked) in.fail("is no calibration: its R is no rotation");
  return *checked;
}

/// Of rectified pictures P, of others K; both are of the whole sensor.
CameraModel pinhole_of(const CameraInfoMessage& message, bool rectified) {
  const auto& from = rectified ? message.p : message.k;
  const std::size_t row = rectified ? 4 : 3;
  const double binning_x = std::max(message.binning_x, 1);
  const double binning_y = std::max(message.binning_y, 1);
  const int width = message.roi_width > 0 ? message.roi_width : message.width;
  const int height = message.roi_height > 0 ? message.roi_height : message.height;
  CameraModel model;
  model.width = static_cast<int>(width / binning_x);
  model.height = static_cast<int>(height / binning_y);
  model.fx = from[0] / binning_x, model.fy = from[row + 1] / binning_y;
  model.cx = (from[2] - message.roi_x) / binning_x;
  model.cy = (from[row + 2] - message.roi_y) / binning_y;
  return model;
}

}  // namespace

Pose InfoCamera::pose_of(const InfoCamera& right) const {
  const Eigen::Matrix3d from_rectified = picture_from_raw() * rectified_from_raw.transpose();
  const Eigen::Matrix3d to_rectified =
      right.rectified_from_raw * right.picture_from_raw().transpose();
  return {from_rectified * to_rectified,
          from_rectified * Eigen::Vector3d(right.right_m - right_m, 0, 0)};
}

std::optional<Eigen::Matrix3d> checked_rotation(const Eigen::Matrix3d& matrix) {
  const bool is_rotation =
      (matrix * matrix.transpose()).isIdentity(1e-3) && matrix.determinant() > 0;
  return is_rotation ? std::optional(nearest_rotation(matrix)) : std::nullopt;
}

std::string no_pinhole(const CameraModel& camera) {
  constexpr double kLongest = 3;  // binned along one axis: 2
  const bool is_centre =
      camera.cx >= 0 && camera.cy >= 0 && camera.cx <= camera.width && camera.cy <= camera.height;
  if (!(camera.fx >= 10 && camera.fy >= 10) || !is_centre) {
    return "fx and fy must be at least 10 pixels, and cx and cy in the picture";
  }
  const double ratio = camera.fx / camera.fy;
  if (ratio < kLongest && ratio > 1 / kLongest) return "";
  return fmt::format("fx is {:g} and fy {:g}: no pixel is so long", camera.fx, camera.fy);
}

std::string odd_camera(const CameraModel& camera) {
  constexpr double kSquare = 1.1, kBent = 3;
  const double ratio = camera.fx / camera.fy;
  if (ratio > kSquare || ratio < 1 / kSquare) {
    return fmt::format("fx is {:g} and fy {:g}, pixels are usually squares", camera.fx, camera.fy);
  }
  const auto is_off = [](double centre, int side) {
    return std::abs(centre / side - 0.5) > 0.25;  // most are within 0.05
  };
  if (is_off(camera.cx, camera.width) || is_off(camera.cy, camera.height)) {
    return fmt::format("the centre of {}x{} pixels is at {:g}, {:g}", camera.width, camera.height,
                       camera.cx, camera.cy);
  }
  if (camera.lens == Lens::kEquidistant) return "";
  for (const double x : {0.0, camera.width - 1.0}) {
    for (const double y : {0.0, camera.height - 1.0}) {
      const Eigen::Vector2d corner(x, y);
      const Eigen::Vector2d ray = camera.ray(corner);
      const double straight = std::hypot((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy);
      const double bent = ray.norm() / straight;
      if (bent < kBent && bent > 1 / kBent && (camera.project(ray) - corner).norm() < 1) continue;
      return fmt::format("the lens bends the corner at {:g}, {:g} out of all measure", x, y);
    }
  }
  return "";
}

std::string set_lens(CameraModel& camera, const std::string& name,
                     std::vector<double> coefficients) {
  const bool is_equidistant = name == "equidistant" || name == "fisheye";
  const std::size_t most = is_equidistant                  ? 4
                           : name == "plumb_bob"           ? 5
                           : name == "rational_polynomial" ? 8
                                                           : 0;
  while (!coefficients.empty() && coefficients.back() == 0) coefficients.pop_back();
  const bool is_sane =
      std::ranges::all_of(coefficients, [](double each) { return std::abs(each) < 1e4; });
  if (coefficients.size() > most || !is_sane) {
    return fmt::format(
        "has lens '{}' with {} coefficients; known are plumb_bob with 5, rational_polynomial with "
        "8 "
        "and equidistant with 4",
        name, coefficients.size());
  }
  coefficients.resize(8, 0);
  const auto& d = coefficients;
  camera.k1 = d[0], camera.k2 = d[1];
  if (is_equidistant) {
    camera.lens = Lens::kEquidistant;
    camera.k3 = d[2], camera.k4 = d[3];
    constexpr double kWidest_deg = 155;  // TUM-VI's show 153
    const double view_deg = camera.widest_view_deg();
    if (view_deg > kWidest_deg) {
      return fmt::format("has an equidistant lens that shows {:.0f} degrees; up to {} are known",
                         view_deg, kWidest_deg);
    }
    return "";
  }
  camera.p1 = d[2], camera.p2 = d[3];
  camera.k3 = d[4], camera.k4 = d[5], camera.k5 = d[6], camera.k6 = d[7];
  return "";
}

bool seems_rectified(const CameraInfoMessage& message) {
  // In y KITTI's K is off by 0.098 and more, its P by less than 0.04.
  constexpr double kOff = 0.08, kNear = 0.05, kOtherFocal = 0.1;
  const CameraModel k = pinhole_of(message, false);
  const CameraModel p = pinhole_of(message, true);
  const auto fits = [](double by_k, double by_p, int side) {
    return std::abs(by_k / side - 0.5) > kOff && std::abs(by_p / side - 0.5) < kNear;
  };
  return (fits(k.cx, p.cx, k.width) || fits(k.cy, p.cy, k.height)) &&
         std::abs(k.fx - p.fx) > kOtherFocal * p.fx;
}

InfoCamera camera_of(const WireReader& in, const CameraInfoMessage& message, bool rectified) {
  InfoCamera camera;
  camera.is_rectified = rectified;
  camera.rectified_from_raw = rotation_in(in, message.r);
  CameraModel& model = camera.model = pinhole_of(message, rectified);
  // Who publishes rectified pictures without P has calibrated none of it.
  // @source  sensor_msgs/CameraInfo: of a camera that is not calibrated K[0] is 0.
  if (model.fx == 0) {
    in.fail(
        fmt::format("says that the camera is not calibrated ({} is 0): calibrate it, or give a "
                    "file that has it: --calibration camchain.yaml",
                    rectified ? "P[0], of rectified pictures," : "K[0]"));
  }
  const std::string problem =
      model.width < 16 || model.height < 16 ? "of less than 16 pixels" : no_pinhole(model);
  if (!problem.empty()) {
    in.fail(fmt::format("is no calibration: {}{}", problem,
                        rectified ? " (in P, which is that of rectified pictures)" : ""));
  }
  if (!rectified) {
    const std::string why_not = set_lens(model, message.distortion_model, message.d);
    if (!why_not.empty()) in.fail(why_not);
  }
  if (message.p[0] > 0) camera.right_m = -message.p[3] / message.p[0];
  if (!std::isfinite(camera.right_m)) in.fail("is no calibration: its P is not finite");
  return camera;
}

}  // namespace pirt
