#include "workloads/slam/filter/state.h"

namespace pirt::slam {

std::string_view to_string(Status status) {
  switch (status) {
    case Status::kStarting:
      return "starting";
    case Status::kTracking:
      return "tracking";
    case Status::kLost:
      return "lost";
  }
  return "";
}

Eigen::Matrix3d position_covariance(const State& state) {
  // p = p^ + turn x p^ + error
  Eigen::Matrix<double, 3, 6> j;
  j << -cross_matrix(state.motion.position), Eigen::Matrix3d::Identity();
  Eigen::Matrix<double, 6, 6> p;
  const auto& all = state.covariance;
  p << all.block<3, 3>(0, 0), all.block<3, 3>(0, kPositionAt), all.block<3, 3>(kPositionAt, 0),
      all.block<3, 3>(kPositionAt, kPositionAt);
  return j * p * j.transpose();
}

Eigen::Matrix3d landmark_covariance(const State& state, std::size_t landmark) {
  const int turn = State::clone_at(state.clones.size() - 1);
  const int at = state.landmark_at(landmark);
  Eigen::Matrix<double, 3, 6> j;
  j << -cross_matrix(state.landmarks[landmark].position), Eigen::Matrix3d::Identity();
  Eigen::Matrix<double, 6, 6> p;
  const auto& all = state.covariance;
  p << all.block<3, 3>(turn, turn), all.block<3, 3>(turn, at), all.block<3, 3>(at, turn),
      all.block<3, 3>(at, at);
  return j * p * j.transpose();
}

Pose camera_pose(const Setup& setup, const Pose& body, std::size_t camera) {
  return body * setup.cameras[camera].body_from_camera;
}

}  // namespace pirt::slam
