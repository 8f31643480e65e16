// A small state of the SLAM by hand.
#pragma once

#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/slam/filter/filter.h"
#include "workloads/slam/filter/measure.h"

namespace pirt::slam {

/// Two clones and a landmark, with a covariance that correlates all.
inline State small_state(const slam::Setup& setup) {
  State state;
  state.motion.rotation = rotation_of({0.2, -0.1, 0.7});
  state.motion.position = {1, 2, 0.5};
  const Eigen::MatrixXd root = Eigen::MatrixXd::Random(kMotionSize, kMotionSize);
  state.covariance = 0.01 * root * root.transpose();
  add_clone(state, 0);
  state.motion.position += Eigen::Vector3d(0.3, -0.2, 0.1);
  state.motion.rotation = state.motion.rotation * rotation_of({0.02, 0.1, -0.05});
  state.covariance.topLeftCorner<kMotionSize, kMotionSize>().diagonal().array() += 0.001;
  add_clone(state, 1);
  const Pose camera = camera_pose(setup, state.clones[0].body, 0);
  Track track;
  const Eigen::Vector3d point = camera * Eigen::Vector3d(0.3, -0.2, 3.0);
  for (std::size_t i = 0; i < 2; ++i) {
    const Eigen::Vector3d p = camera_pose(setup, state.clones[i].body, 0).inverse() * point;
    Observation seen;
    seen.frame = static_cast<std::int64_t>(i);
    seen.left = p.head<2>() / p.z();
    track.seen.push_back(seen);
  }
  const PointRows rows = rows_of_track(state, setup, track, point);
  RowBlock block = rows.rows;
  block.parts.push_back({State::clone_at(1), rows.to_point * -cross_matrix(point)});
  NewLandmark added{{}, block, rows.to_point};
  added.landmark.position = point;
  add_landmarks(state, std::span(&added, 1));
  state.tracks.push_back(track);
  return state;
}

inline slam::Setup one_camera() {
  slam::Setup setup;
  setup.cameras.push_back(generate_sequence(test::scene(1, 1.0)).cameras[0]);
  return setup;
}

}  // namespace pirt::slam
