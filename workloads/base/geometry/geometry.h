// Rigid poses, as all of sequences, scenes and SLAM use them. Lengths in metres, angles in radians.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace pirt {

/// Maps points of one frame into another: x_to = rotation * x_from + position.
struct Pose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();

  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return rotation * point + position;
  }
  [[nodiscard]] Pose operator*(const Pose& other) const {
    return {rotation * other.rotation, rotation * other.position + position};
  }
  [[nodiscard]] Pose inverse() const {
    return {rotation.transpose(), -(rotation.transpose() * position)};
  }
};

[[nodiscard]] inline Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// The rotation by |@p vector| about it (SO(3) exponential).
[[nodiscard]] inline Eigen::Matrix3d rotation_of(const Eigen::Vector3d& vector) {
  const double angle = vector.norm();
  if (angle < 1e-12) return Eigen::Matrix3d::Identity() + cross_matrix(vector);
  return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

/// The inverse of rotation_of(): axis times angle, angle within [0, pi].
[[nodiscard]] inline Eigen::Vector3d vector_of(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(Eigen::Quaterniond(rotation).normalized());
  return turn.angle() * turn.axis();
}

/// In radians, within [0, pi].
[[nodiscard]] inline double angle_of(const Eigen::Matrix3d& rotation) {
  return vector_of(rotation).norm();
}

[[nodiscard]] inline Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix) {
  return Eigen::Quaterniond(matrix).normalized().toRotationMatrix();
}

inline constexpr double kGravity = 9.81;  ///< m/s^2, along -z of the world.
inline constexpr double kDegreesPerRadian = 57.29577951308232;

}  // namespace pirt
