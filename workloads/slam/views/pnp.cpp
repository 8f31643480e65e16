#include "workloads/slam/views/pnp.h"

#include <opencv2/calib3d.hpp>

#include "workloads/base/error.h"

namespace pirt::slam {
namespace {

constexpr std::size_t kLeast = 6;

Pose pose_of(const cv::Mat& rotation_vector, const cv::Mat& translation) {
  const Eigen::Vector3d w(rotation_vector.at<double>(0), rotation_vector.at<double>(1),
                          rotation_vector.at<double>(2));
  const Eigen::Vector3d t(translation.at<double>(0), translation.at<double>(1),
                          translation.at<double>(2));
  return Pose{rotation_of(w), t}.inverse();
}

}  // namespace

std::optional<PnpResult> robust_pnp(std::span<const PointMatch> matches, double most_miss) {
  if (matches.size() < kLeast) return std::nullopt;
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> rays;
  for (const auto& match : matches) {
    points.emplace_back(match.point.x(), match.point.y(), match.point.z());
    rays.emplace_back(match.ray.x(), match.ray.y());
  }
  try {
    cv::Mat rotation;
    cv::Mat translation;
    std::vector<int> inliers;
    constexpr int kRounds = 200;
    constexpr double kConfidence = 0.999;
    const bool found = cv::solvePnPRansac(
        points, rays, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotation, translation, false,
        kRounds, static_cast<float>(most_miss), kConfidence, inliers, cv::SOLVEPNP_EPNP);
    if (!found || inliers.size() < kLeast) return std::nullopt;
    PnpResult result;
    result.camera = pose_of(rotation, translation);
    if (!result.camera.position.allFinite() || !result.camera.rotation.allFinite()) {
      return std::nullopt;
    }
    result.inliers.assign(inliers.begin(), inliers.end());
    return result;
  } catch (const cv::Exception& error) {
    throw_environment("OpenCV cannot find a pose: " + error.err);
  }
}

}  // namespace pirt::slam
