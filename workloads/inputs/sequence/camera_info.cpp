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
  if (!(rotation * rotation.transpose()).isIdentity(1e-3) || rotation.determinant() < 0) {
    in.fail("is no calibration: its R is no rotation");
  }
  return nearest_rotation(rotation);
}

}  // namespace

Pose InfoCamera::pose_of(const InfoCamera& right) const {
  const Eigen::Matrix3d from_rectified = picture_from_raw() * rectified_from_raw.transpose();
  const Eigen::Matrix3d to_rectified =
      right.rectified_from_raw * right.picture_from_raw().transpose();
  return {from_rectified * to_rectified,
          from_rectified * Eigen::Vector3d(right.right_of_left_m, 0, 0)};
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

InfoCamera camera_of(const WireReader& in, const CameraInfoMessage& message, bool rectified) {
  InfoCamera camera;
  camera.is_rectified = rectified;
  camera.rectified_from_raw = rotation_in(in, message.r);
  CameraModel& model = camera.model;
  // Who publishes rectified pictures without P has calibrated none of it.
  const auto& from = rectified ? message.p : message.k;
  const std::size_t row = rectified ? 4 : 3;
  const double binning_x = std::max(message.binning_x, 1);
  const double binning_y = std::max(message.binning_y, 1);
  const int width = message.roi_width > 0 ? message.roi_width : message.width;
  const int height = message.roi_height > 0 ? message.roi_height : message.height;
  model.width = static_cast<int>(width / binning_x);
  model.height = static_cast<int>(height / binning_y);
  model.fx = from[0] / binning_x, model.fy = from[row + 1] / binning_y;
  model.cx = (from[2] - message.roi_x) / binning_x;
  model.cy = (from[row + 2] - message.roi_y) / binning_y;
  if (model.width < 16 || model.height < 16 || !(model.fx >= 10) || !(model.fy >= 10) ||
      !(model.cx >= 0 && model.cx <= model.width) || !(model.cy >= 0 && model.cy <= model.height)) {
    in.fail(fmt::format(
        "is no calibration: fx and fy{} are at least 10 pixels, cx and cy in the picture",
        rectified ? " in P, which is that of rectified pictures," : ""));
  }
  if (!rectified) {
    const std::string problem = set_lens(model, message.distortion_model, message.d);
    if (!problem.empty()) in.fail(problem);
  }
  if (message.p[0] > 0) camera.right_of_left_m = -message.p[3] / message.p[0];
  if (!std::isfinite(camera.right_of_left_m)) in.fail("is no calibration: its P is not finite");
  return camera;
}

}  // namespace pirt
