// Keyframes of a localization: some of its frames, with what each saw, as a problem of bundle
// adjustment, and their poses and points back from it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "workloads/inputs/sequence/trajectory.h"
#include "workloads/mapping/bundle_adjust.h"
#include "workloads/slam/filter/map_points.h"
#include "workloads/slam/filter/measure.h"
#include "workloads/slam/filter/state.h"

namespace pirt::mapping {

/// A point as a frame saw it: rays (x, y, 1), undistorted.
struct Sighting {
  std::int64_t point = 0;  ///< Of the track.
  Eigen::Vector2d ray = Eigen::Vector2d::Zero();
  std::optional<Eigen::Vector2d> right = {};
  slam::Descriptor descriptor{};
};

/// A way as the localization has it at its end, and how well, an axis. Where a pose was when it was
/// new tells less: it has been corrected since.
struct Step {
  Pose way;  ///< Body to the body before.
  double turn_rad = 0, move_m = 0;
};

struct Keyframe {
  StampedPose pose;
  std::int64_t frame = 0;
  double sigma_m = 0;             ///< Of the position, an axis, as the localization knows it.
  double sigma_rad = 0;           ///< Likewise of the attitude; with an IMU gravity holds it.
  std::int64_t milestone = -1;    ///< Of the localization, that it moves with; -1 = of none.
  double near_sigma_m = 0;        ///< Of the position against it; without one, sigma_m.
  std::optional<Step> step = {};  ///< From the keyframe before; absent = not known.
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
  std::vector<StampedPose> keyframes;  ///< As many as there were, in their order.
  /// Of the world, those of the problem that are seen where they are, against the milestones of the
  /// keyframes that saw them first; their ids are those of landmarks, or of tracks that were none.
  std::vector<slam::MapPoint> points;
  std::vector<slam::Clone> milestones;  ///< As they were when the last keyframe was taken.
  BundleSummary summary;
};

/// Points for slam::correct_map, which may come while milestones have moved on.
/// @param in_map  The localization was in the world of a map that it found.
[[nodiscard]] slam::BetterMap better_map(const RefinedMap& refined, bool in_map = false);

class Keyframes {
 public:
  explicit Keyframes(slam::Setup setup, KeyframeOptions options = {});

  /// Takes the state after a frame (slam::extend_map). What was taken before moves with its
  /// milestones: the localization may have learnt since where these are.
  /// @return  Whether it became a keyframe; never before the state tracks.
  bool add(const slam::State& state);
  [[nodiscard]] std::span<const Keyframe> all() const { return keyframes_; }

  /// A camera a keyframe, with the left camera's focal length and no distortion, after them as many
  /// right ones if there are two, and the points that at least 3 of them saw from places that tell
  /// where it is. Keyframes that see fewer than 12 of these have no observations, and stay as they
  /// are.
  [[nodiscard]] BalProblem problem() const;
  /// Of the cameras of problem(): where the localization has them, how they are turned, and how
  /// sure it is. It has seen more than the points that are followed, and may feel gravity; these
  /// points bend and tilt a map as a whole, since they drift over what they show.
  [[nodiscard]] std::vector<PosePrior> priors() const;
  /// How the two cameras are mounted, and how the localization has each keyframe against the one
  /// before.
  [[nodiscard]] std::vector<RelativePose> relative() const;
  /// The keyframes' poses and the points in a problem() that was adjusted. What no camera tells,
  /// where the whole is, which way it looks and, of one camera, how large it is, is as before: it
  /// is moved, turned and scaled as a whole to where the localization had it.
  /// @throws Error{kBadInput} if it has another number of cameras, or fewer than 3 of them see
  /// anything.
  [[nodiscard]] RefinedMap refined(const BalProblem& adjusted) const;

 private:
  struct View {
    std::size_t keyframe;
    const Sighting* seen;
  };
  struct Point {
    std::int64_t id;
    Eigen::Vector3d place;
    std::vector<View> views;
  };
  void follow_milestones(const slam::State& state);
  void thin_out();
  [[nodiscard]] std::size_t camera_count() const;
  /// Of keyframe i the left camera is i, the right one as many further on as there are keyframes.
  [[nodiscard]] Pose camera(std::size_t index) const;
  /// Of both cameras. @param cameras  Pose(index), as camera().
  template <typename Cameras>
  [[nodiscard]] std::vector<slam::View> rays_of(std::span<const View> views,
                                                const Cameras& cameras) const;
  /// Those of problem(), in its order.
  [[nodiscard]] std::vector<Point> points() const;
  [[nodiscard]] std::vector<slam::MapPoint> map_points(const BalProblem& adjusted,
                                                       const Similarity& back) const;

  slam::Setup setup_;
  KeyframeOptions options_;
  std::vector<Keyframe> keyframes_;
  std::vector<slam::Clone> milestones_;  ///< As they were when a state was last taken.
  /// Tracks that became landmarks: one point, whichever of them a keyframe saw.
  std::map<std::int64_t, std::int64_t> landmarks_;
};

/// problem(), bundle_adjust() with robot_options(), priors(), relative(), and refined() in one.
/// @throws Error{kBadInput} if there are no points that can be adjusted.
[[nodiscard]] RefinedMap refine(const Keyframes& keyframes);

}  // namespace pirt::mapping
