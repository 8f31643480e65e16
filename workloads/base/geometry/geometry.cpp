#include "workloads/base/geometry/geometry.h"

#include <Eigen/Geometry>

namespace pirt {

Pose Pose::operator*(const Pose& other) const {
  return {rotation * other.rotation, rotation * other.position + position};
}

Pose Pose::inverse() const { return {rotation.transpose(), -(rotation.transpose() * position)}; }

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Eigen::Matrix3d rotation_of(const Eigen::Vector3d& vector) {
  const double angle = vector.norm();
  if (angle < 1e-12) return Eigen::Matrix3d::Identity() + cross_matrix(vector);
  return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

Eigen::Vector3d vector_of(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(Eigen::Quaterniond(rotation).normalized());
  return turn.angle() * turn.axis();
}

double angle_of(const Eigen::Matrix3d& rotation) { return vector_of(rotation).norm(); }

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix) {
  return Eigen::Quaterniond(matrix).normalized().toRotationMatrix();
}

}  // namespace pirt
