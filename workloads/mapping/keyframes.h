// Keyframes of a localization: some of its frames, with what each saw, as a problem of bundle
// adjustment, and their poses back from it.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "workloads/inputs/sequence/trajectory.h"
#include "workloads/mapping/bundle_adjust.h"
#include "workloads/slam/filter/state.h"

namespace pirt::mapping {

/// A point as a frame saw it with its left camera.
struct Sighting {
  std::int64_t point = 0;
  Eigen::Vector2d ray = Eigen::Vector2d::Zero();  ///< (x, y, 1), undistorted.
};

struct Keyframe {
  StampedPose pose;
  double sigma_m = 0;  ///< Of the position, an axis, as the localization knows it.
  std::vector<Sighting> seen;
};

/// A frame becomes a keyframe when the body has moved or turned so far since the last one. Where
/// there are too many, every second one goes, and both distances double.
struct KeyframeOptions {
  double least_move_m = 0.15;
  double least_turn_rad = 0.15;
  std::size_t most = 100;  ///< At least 3; what the workload bundle_adjust has room for.
};

/// What bundle adjustment made of keyframes.
struct RefinedMap {
  std::vector<StampedPose> keyframes;   ///< As many as there were, in their order.
  std::vector<Eigen::Vector3d> points;  ///< Of the world, those of the problem.
  BundleSummary summary;
};

class Keyframes {
 public:
  explicit Keyframes(slam::Setup setup, KeyframeOptions options = {});

  /// Takes the state after a frame (slam::extend_map).
  /// @return  Whether it became a keyframe; never before the state tracks.
  bool add(const slam::State& state);
  [[nodiscard]] std::span<const Keyframe> all() const { return keyframes_; }

  /// One camera a keyframe, with the left camera's focal length and no distortion, and the points
  /// that at least 3 of them saw from places that tell where it is. Keyframes that see fewer than
  /// 12 of these have no observations, and stay as they are.
  [[nodiscard]] BalProblem problem() const;
  /// Of the cameras of problem(): where the localization has them, and how sure it is. It has seen
  /// more than the points that are followed, and these bend a map as a whole, since they drift over
  /// what they show.
  [[nodiscard]] std::vector<CentrePrior> priors() const;
  /// The keyframes' poses in a problem() that was adjusted. What no camera tells, where the whole
  /// is, which way it looks and how large it is, is as before: the poses are moved, turned and
  /// scaled as a whole to where the localization had them.
  /// @throws Error{kBadInput} if it has another number of cameras, or fewer than 3 of them see
  /// anything.
  [[nodiscard]] RefinedMap refined(const BalProblem& adjusted) const;

 private:
  void thin_out();
  [[nodiscard]] Pose camera(std::size_t keyframe) const;

  slam::Setup setup_;
  KeyframeOptions options_;
  std::vector<Keyframe> keyframes_;
  /// Tracks that became landmarks: one point, whichever of them a keyframe saw.
  std::map<std::int64_t, std::int64_t> landmarks_;
};

/// problem(), bundle_adjust() with robot_options() and priors(), and refined() in one.
/// @throws Error{kBadInput} if there are no points that can be adjusted.
[[nodiscard]] RefinedMap refine(const Keyframes& keyframes);

}  // namespace pirt::mapping
