#include "workloads/slam/views/two_views.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <vector>

#include "workloads/base/error.h"

namespace pirt::slam {
namespace {

constexpr double kConfidence = 0.999;
constexpr std::size_t kLeastPoints = 20;
constexpr double kCauchy = 2.385;  // sigma: 95 % efficient where all is Gaussian

struct Points {
  std::vector<cv::Point2d> first, second;
};

Points points_of(std::span<const RayPair> pairs) {
  Points points;
  for (const auto& pair : pairs) {
    points.first.emplace_back(pair.first.x(), pair.first.y());
    points.second.emplace_back(pair.second.x(), pair.second.y());
  }
  return points;
}

/// Of a matrix of doubles, of the same size.
template <typename Matrix>
Matrix eigen_of(const cv::Mat& m) {
  Matrix matrix;
  cv::cv2eigen(m, matrix);
  return matrix;
}

/// x_second ~ rotation * x_first + (something) * direction.
struct RelativeMotion {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d direction;  ///< Of length 1; its sign does not matter here.
};

/// Signed, of a pair from the epipolar constraint, in radians near the axis.
double sampson(const Eigen::Matrix3d& essential, const RayPair& pair) {
  const Eigen::Vector3d a = pair.first.homogeneous();
  const Eigen::Vector3d b = pair.second.homogeneous();
  const Eigen::Vector3d line = essential * a;
  const Eigen::Vector3d back = essential.transpose() * b;
  const double square = line.head<2>().squaredNorm() + back.head<2>().squaredNorm();
  return square > 0 ? b.dot(line) / std::sqrt(square) : 0.0;
}

Eigen::Matrix3d essential_of(const RelativeMotion& motion) {
  return cross_matrix(motion.direction) * motion.rotation;
}

Eigen::VectorXd residuals_of(const RelativeMotion& motion, std::span<const RayPair> pairs) {
  const Eigen::Matrix3d essential = essential_of(motion);
  Eigen::VectorXd residuals(std::ssize(pairs));
  for (Eigen::Index i = 0; i < residuals.size(); ++i) {
    residuals(i) = sampson(essential, pairs[static_cast<std::size_t>(i)]);
  }
  return residuals;
}

/// Moves by a rotation (3) and along the sphere of directions (2).
RelativeMotion moved(const RelativeMotion& motion, const Eigen::Matrix<double, 5, 1>& by) {
  const Eigen::Vector3d u = motion.direction.unitOrthogonal();
  const Eigen::Vector3d v = motion.direction.cross(u);
  return {nearest_rotation(rotation_of(by.head<3>()) * motion.rotation),
          (motion.direction + by(3) * u + by(4) * v).normalized()};
}

/// 1.4826 times the median of what the residuals are in size: sigma of those that are Gaussian.
double spread_of(const Eigen::VectorXd& residuals) {
  std::vector<double> sizes(residuals.data(), residuals.data() + residuals.size());
  for (double& size : sizes) size = std::abs(size);
  const auto middle = sizes.begin() + std::ssize(sizes) / 2;
  std::ranges::nth_element(sizes, middle);
  return 1.4826 * *middle;
}

/// Gauss-Newton; @p motion becomes the best one, @p pairs are its inliers.
Turn refined(RelativeMotion& motion, std::span<const RayPair> pairs) {
  constexpr int kSteps = 6;
  constexpr double kLeastSigma = 1e-6;  // of points without noise
  constexpr double kStep = 1e-6;        // of differences, radians
  Turn turn;
  Eigen::Matrix<double, 5, 5> information;
  for (int step = 0; step <= kSteps; ++step) {
    const Eigen::VectorXd residuals = residuals_of(motion, pairs);
    turn.ray_sigma = std::max(kLeastSigma, spread_of(residuals));
    Eigen::MatrixXd jacobian(residuals.size(), 5);
    for (int column = 0; column < 5; ++column) {
      const auto by = Eigen::Matrix<double, 5, 1>::Unit(column) * kStep;
      jacobian.col(column) =
          (residuals_of(moved(motion, by), pairs) - residuals_of(moved(motion, -by), pairs)) /
          (2 * kStep);
    }
    const double scale = kCauchy * turn.ray_sigma;
    const Eigen::VectorXd weights = 1.0 / (1.0 + (residuals.array() / scale).square());
    const Eigen::MatrixXd weighted =
        jacobian.transpose() * weights.asDiagonal() / (turn.ray_sigma * turn.ray_sigma);
    information = weighted * jacobian;
    // Any direction may be: what keeps this solvable where the camera did not move.
    information(3, 3) += 1;
    information(4, 4) += 1;
    if (step < kSteps) motion = moved(motion, information.ldlt().solve(-weighted * residuals));
  }
  turn.rotation = motion.rotation;
  turn.covariance =
      Eigen::Matrix3d(Eigen::Matrix<double, 5, 5>(information.inverse()).topLeftCorner<3, 3>());
  turn.inliers = pairs.size();
  return turn;
}

std::vector<RayPair> inliers_of(const RelativeMotion& motion, std::span<const RayPair> pairs,
                                double most_miss) {
  const Eigen::Matrix3d essential = essential_of(motion);
  std::vector<RayPair> inliers;
  for (const auto& pair : pairs) {
    if (std::abs(sampson(essential, pair)) < most_miss) inliers.push_back(pair);
  }
  return inliers;
}

/// A motion and what it is known by.
struct Fit {
  RelativeMotion motion;
  Turn turn;
};

std::optional<Fit> fit_from(const RelativeMotion& start, std::span<const RayPair> pairs,
                            double most_miss) {
  if (!start.rotation.allFinite() || !start.direction.allFinite()) return std::nullopt;
  Fit fit{start, {}};
  // Again with what the refined motion takes in: the start knew few points or none.
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    const auto inliers = inliers_of(fit.motion, pairs, most_miss);
    if (inliers.size() < kLeastPoints || 2 * inliers.size() < pairs.size()) return std::nullopt;
    fit.turn = refined(fit.motion, inliers);
  }
  if (!fit.turn.rotation.allFinite() || !fit.turn.covariance.allFinite()) return std::nullopt;
  return fit;
}

/// Five points' motion that most agree with.
std::optional<RelativeMotion> drawn_motion(std::span<const RayPair> pairs, double most_miss) {
  const Points points = points_of(pairs);
  try {
    const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
    const cv::Mat essential = cv::findEssentialMat(points.first, points.second, identity,
                                                   cv::RANSAC, kConfidence, most_miss);
    if (essential.rows != 3) return std::nullopt;
    cv::Mat one;
    cv::Mat other;
    cv::Mat t;
    cv::decomposeEssentialMat(essential, one, other, t);
    // The two differ by half a turn about the direction: the smaller one is meant.
    const Eigen::Matrix3d a = eigen_of<Eigen::Matrix3d>(one);
    const Eigen::Matrix3d b = eigen_of<Eigen::Matrix3d>(other);
    return RelativeMotion{angle_of(a) <= angle_of(b) ? a : b,
                          eigen_of<Eigen::Vector3d>(t).normalized()};
  } catch (const cv::Exception& error) {
    throw_environment("OpenCV cannot find a motion: " + error.err);
  }
}

/// The direction in which all points move by what is left after a turn.
RelativeMotion motion_with(const Eigen::Matrix3d& turn, std::span<const RayPair> pairs) {
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const auto& pair : pairs) {
    const Eigen::Vector3d turned = turn * pair.first.homogeneous();
    const Eigen::Vector3d seen = pair.second.homogeneous();
    const Eigen::Vector3d normal = turned.cross(seen);
    scatter += normal * normal.transpose();
  }
  return {turn, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors().col(0)};
}

/// How badly a motion fits all pairs, with Cauchy's loss, in squares of @p ray_sigma.
double misfit(const RelativeMotion& motion, std::span<const RayPair> pairs, double ray_sigma) {
  const double scale = kCauchy * ray_sigma;
  return kCauchy * kCauchy *
         (1.0 + (residuals_of(motion, pairs).array() / scale).square()).log().sum();
}

/// A picture of a wall is fitted by two motions nearly as well, whose turns differ by a degree, and
/// the points that RANSAC draws do not tell which is which. All points do; where they do not by
/// five sigma, it is the one that is reached from the turn that was expected.
std::optional<Fit> best_fit(std::span<const RayPair> pairs, double most_miss,
                            const Eigen::Matrix3d& expected) {
  if (pairs.size() < kLeastPoints) return std::nullopt;
  auto near = fit_from(motion_with(expected, pairs), pairs, most_miss);
  const auto start = drawn_motion(pairs, most_miss);
  auto drawn = start ? fit_from(*start, pairs, most_miss) : std::nullopt;
  if (!near || !drawn) return near ? near : drawn;
  constexpr double kClearly = 25.0;
  const double sigma = std::min(near->turn.ray_sigma, drawn->turn.ray_sigma);
  const bool clearly =
      misfit(drawn->motion, pairs, sigma) + kClearly < misfit(near->motion, pairs, sigma);
  return clearly ? drawn : near;
}

}  // namespace

std::optional<Pose> two_views(std::span<const RayPair> pairs, double most_miss) {
  const auto fit = best_fit(pairs, most_miss, Eigen::Matrix3d::Identity());
  if (!fit) return std::nullopt;
  const auto inliers = inliers_of(fit->motion, pairs, most_miss);
  const Points points = points_of(inliers);
  try {
    cv::Mat essential;
    cv::eigen2cv(essential_of(fit->motion), essential);
    cv::Mat r;
    cv::Mat t;
    const int count =
        cv::recoverPose(essential, points.first, points.second, cv::Mat::eye(3, 3, CV_64F), r, t);
    if (2 * count < static_cast<int>(pairs.size())) return std::nullopt;
    return Pose{eigen_of<Eigen::Matrix3d>(r), eigen_of<Eigen::Vector3d>(t)}.inverse();
  } catch (const cv::Exception& error) {
    throw_environment("OpenCV cannot find a motion: " + error.err);
  }
}

std::optional<Turn> turn_of(std::span<const RayPair> pairs, double most_miss,
                            const Eigen::Matrix3d& expected) {
  const auto fit = best_fit(pairs, most_miss, expected);
  return fit ? std::optional(fit->turn) : std::nullopt;
}

}  // namespace pirt::slam
