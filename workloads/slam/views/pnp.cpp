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

/// Matches as OpenCV takes them.
struct Matches {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> rays;

  void add(const PointMatch& match) {
    points.emplace_back(match.point.x(), match.point.y(), match.point.z());
    rays.emplace_back(match.ray.x(), match.ray.y());
  }
};

std::vector<std::size_t> inliers_of(std::span<const PointMatch> matches, const Pose& camera,
                                    double most_miss) {
  const Pose from_world = camera.inverse();
  std::vector<std::size_t> inliers;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Eigen::Vector3d p = from_world * matches[i].point;
    if (p.z() > 0 && (p.head<2>() / p.z() - matches[i].ray).norm() < most_miss) {
      inliers.push_back(i);
    }
  }
  return inliers;
}

}  // namespace

std::optional<PnpResult> robust_pnp(std::span<const PointMatch> matches, double most_miss) {
  if (matches.size() < kLeast) return std::nullopt;
  Matches all;
  for (const auto& match : matches) all.add(match);
  const cv::Mat unit = cv::Mat::eye(3, 3, CV_64F);
  try {
    cv::Mat rotation;
    cv::Mat translation;
    std::vector<int> consensus;
    constexpr int kRounds = 200;
    constexpr double kConfidence = 0.999;
    const bool found = cv::solvePnPRansac(
        all.points, all.rays, unit, cv::noArray(), rotation, translation, false, kRounds,
        static_cast<float>(most_miss), kConfidence, consensus, cv::SOLVEPNP_AP3P);
    if (!found) return std::nullopt;
    PnpResult result;
    result.inliers.assign(consensus.begin(), consensus.end());
    // Twice: the least squares decide what fits, and are then those of what does.
    for (int round = 0; round < 2; ++round) {
      if (result.inliers.size() < kLeast) return std::nullopt;
      Matches good;
      for (const std::size_t i : result.inliers) good.add(matches[i]);
      if (round == 0 && !cv::solvePnP(good.points, good.rays, unit, cv::noArray(), rotation,
                                      translation, false, cv::SOLVEPNP_SQPNP)) {
        return std::nullopt;
      }
      cv::solvePnPRefineLM(good.points, good.rays, unit, cv::noArray(), rotation, translation);
      result.camera = pose_of(rotation, translation);
      if (!result.camera.position.allFinite() || !result.camera.rotation.allFinite()) {
        return std::nullopt;
      }
      result.inliers = inliers_of(matches, result.camera, most_miss);
    }
    if (result.inliers.size() < kLeast) return std::nullopt;
    return result;
  } catch (const cv::Exception& error) {
    throw_environment("OpenCV cannot find a pose: " + error.err);
  }
}

}  // namespace pirt::slam
