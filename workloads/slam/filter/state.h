// All that the SLAM remembers from one frame to the next: one value, copied, compared and moved as
// such. Each step is a function of it and of its inputs; nothing is kept elsewhere.
//
// A Kalman filter over the body's motion, the last poses ("clones") and some landmarks. Its error
// is right-invariant: a rotation error turns everything about the world's origin, so that what no
// sensor can observe (where the origin is, which way is north) stays unobserved by the linearized
// filter, too, and its covariance stays honest.
//
// @source  Mourikis and Roumeliotis, A multi-state constraint Kalman filter, ICRA 2007; Barrau and
// Bonnabel, The invariant extended Kalman filter as a stable observer, TAC 2017; Wu et al., An
// invariant-EKF VINS algorithm for improving consistency, IROS 2017.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "workloads/inputs/sequence/sequence.h"
#include "workloads/inputs/sequence/trajectory.h"
#include "workloads/vision/features.h"

namespace pirt::slam {

enum class Status : std::uint8_t {
  kStarting,  ///< No pose yet, or the one at the start, at rest.
  kTracking,
  kLost,  ///< The pose is a guess; its covariance says how bad.
};
[[nodiscard]] std::string_view to_string(Status status);

/// A point of the world outside of the filter: known again, and corrected by correct_map() alone.
struct MapPoint {
  std::int64_t id = -1;  ///< Of the landmark or track that it was; -1 = of another run.
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  /// Of the place against its milestone, world axes; without one against the world.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Descriptor descriptor{};
  Eigen::Vector3d seen_from = Eigen::Vector3d::Zero();  ///< Where it was described.
  std::int64_t last_frame = 0;
  std::int64_t milestone = -1;  ///< Frame of the milestone that it moves with; -1 = of none.
};

/// What the robot is built of, and how much work is done. Does not change during a run.
struct Setup {
  std::vector<CameraModel> cameras;  ///< 1 or 2.
  std::optional<ImuModel> imu;       ///< Absent: the motion model is constant velocity.

  int most_tracks = 150;       ///< Points followed from frame to frame.
  int most_clones = 11;        ///< Past poses in the filter that tracks are seen from.
  int most_milestones = 24;    ///< Past poses that stay in the filter (milestones.h).
  int most_landmarks = 60;     ///< Points in the filter.
  int most_active = 30;        ///< Of those, how many are followed at once.
  int most_map_points = 2000;  ///< Points that are known again, outside of the filter.
  /// Of the ray of a followed point. An angle, since a window drifts over the scene, not over the
  /// picture: of whole tracks some 10 % of it is left as residual at 320 and 640 pixels of a
  /// generated room and at 1241 of a street.
  double ray_sigma_rad = 0.0018;
  /// Of a landmark's place in one picture, in pixels: what a window has drifted by (README.md).
  /// It is seen in many frames: counted as independent, each must weigh less.
  double landmark_sigma = 5.0;
  bool update = true;     ///< false: motion only, to see what the updates correct.
  bool recognize = true;  ///< false: what was lost from view is not known again.
  /// A map of an earlier run, in a world of its own, to be found; null = there is none. Its points
  /// are independent of what this run sees.
  std::shared_ptr<const std::vector<MapPoint>> known = {};

  /// Of a followed point, in pixels of the left camera.
  [[nodiscard]] double pixel_sigma() const { return ray_sigma_rad * cameras[0].focal(); }
};

struct MotionState {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< body -> world
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();      ///< m/s, world.
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  /// rad/s. Without an IMU the turn that is taken to go on, negated.
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();
};

struct Clone {
  std::int64_t frame = 0;
  Pose body;
};

/// A point of the world that is in the filter.
struct Landmark {
  std::int64_t id = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Descriptor descriptor{};
  Eigen::Vector3d seen_from = Eigen::Vector3d::Zero();  ///< Where it was described.
  std::int64_t last_frame = 0;                          ///< When it was last used.
  int uses = 0;
  int misses = 0;  ///< How often it should have been seen, and was not found, since.
};

/// Rays (x, y, 1) of each camera in which a clone saw a point.
struct Observation {
  std::int64_t frame = 0;
  Eigen::Vector2d left = Eigen::Vector2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  bool has_right = false;
};

/// A point that is being followed.
struct Track {
  std::int64_t id = 0;
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
  Eigen::Vector2f right_pixel = Eigen::Vector2f::Zero();
  Eigen::Vector2f rest = Eigen::Vector2f::Zero();  ///< `pixel` when motion was last looked for.
  bool has_right = false;
  std::int64_t landmark = -1;  ///< Its id in the filter; -1 = none.
  int age = 0;                 ///< Frames.
  double depth = 0;            ///< Metres along the left camera's axis, a guess; 0 = unknown.
  Descriptor descriptor{};
  std::vector<Observation> seen;  ///< By clones that are in the filter.
};

/// Where the known map may lie, as far as views of it agree.
struct MapSearch {
  Similarity map_from_world;         ///< By the last view.
  int views = 0;                     ///< In a row that agree.
  std::vector<std::int32_t> points;  ///< Of the known map that they saw, rising.
  /// How often a point was seen where the map has it and its mirror image has not, and how often
  /// the other way round.
  int direct = 0, mirrored = 0;
};

inline constexpr int kMotionSize = 15;  ///< rotation, velocity, position, gyro and accel bias.
inline constexpr int kCloneSize = 6;    ///< rotation, position.
inline constexpr int kVelocityAt = 3, kPositionAt = 6, kGyroBiasAt = 9, kAccelBiasAt = 12;

struct State {
  Status status = Status::kStarting;
  Nanos time{};
  std::int64_t frame = -1;  ///< Of the last clone.
  MotionState motion;
  std::vector<Clone> clones;        ///< Oldest first.
  int milestones = 0;               ///< Of the clones the first so many stay.
  std::vector<Landmark> landmarks;  ///< Their rotation error is that of the newest clone.
  /// f64 [n,n], n = 15 + 6 clones + 3 landmarks, in this order.
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(kMotionSize, kMotionSize);
  std::vector<MapPoint> map;
  std::vector<Track> tracks;
  std::int64_t next_id = 0;
  ImuSample last_imu;              ///< At `time`; stamp 0 = none yet.
  std::vector<ImuSample> waiting;  ///< Of the start, until there are enough.
  MapSearch search;                ///< Of the setup's known map, until it is found.
  bool in_map = false;             ///< It was found: the world is its world.
  /// Of the world in which the run began, once the map was found.
  Similarity map_from_start;
  std::vector<std::int32_t> taken;  ///< Points of the known map that became landmarks, rising.
  Nanos previous_time{};            ///< Of the frame before.
  bool still = false;               ///< At rest, by the last frame.
  int blind_frames = 0;             ///< In a row without enough to see.
  int good_frames = 0;              ///< In a row with.
  int still_frames = 0;             ///< Since motion was last looked for.

  [[nodiscard]] int size() const { return static_cast<int>(covariance.rows()); }
  [[nodiscard]] static int clone_at(std::size_t i) {
    return kMotionSize + kCloneSize * static_cast<int>(i);
  }
  [[nodiscard]] int landmark_at(std::size_t i) const {
    return clone_at(clones.size()) + 3 * static_cast<int>(i);
  }
  [[nodiscard]] Pose body() const { return {motion.rotation, motion.position}; }
};

/// Whether there is a known map whose place is not known yet.
[[nodiscard]] inline bool seeks_map(const State& state, const Setup& setup) {
  return setup.known != nullptr && !state.in_map;
}

/// Covariance of the body's position, in metres^2, world axes: the invariant error's, mapped.
[[nodiscard]] Eigen::Matrix3d position_covariance(const State& state);
/// Of a landmark.
[[nodiscard]] Eigen::Matrix3d landmark_covariance(const State& state, std::size_t landmark);

/// The newest clone's pose of a camera.
[[nodiscard]] Pose camera_pose(const Setup& setup, const Pose& body, std::size_t camera);

}  // namespace pirt::slam
