// Rigid poses, as all of sequences, scenes and SLAM use them. Lengths in metres, angles in radians.
//
// What is not called for each pixel is compiled in geometry.cpp: Eigen's templates in this header
// would cost each of its users a second.
#pragma once

#include <Eigen/Core>

namespace pirt {

/// Maps points of one frame into another: x_to = rotation * x_from + position.
struct Pose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();

  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return rotation * point + position;
  }
  [[nodiscard]] Pose operator*(const Pose& other) const;
  [[nodiscard]] Pose inverse() const;
};

[[nodiscard]] Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v);

/// The rotation by |@p vector| about it (SO(3) exponential).
[[nodiscard]] Eigen::Matrix3d rotation_of(const Eigen::Vector3d& vector);

/// The inverse of rotation_of(): axis times angle, angle within [0, pi].
[[nodiscard]] Eigen::Vector3d vector_of(const Eigen::Matrix3d& rotation);

/// In radians, within [0, pi].
[[nodiscard]] double angle_of(const Eigen::Matrix3d& rotation);

[[nodiscard]] Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix);

inline constexpr double kGravity = 9.81;  ///< m/s^2, along -z of the world.
inline constexpr double kDegreesPerRadian = 57.29577951308232;

}  // namespace pirt
