// A short flight without pictures: a robot's path through a room of random points, what its IMU
// measures, and which points its camera would show where. For the workloads of the SLAM's steps,
// which need inputs that fit their state.
#pragma once

#include <cstdint>
#include <vector>

#include "workloads/inputs/scene/path.h"
#include "workloads/slam/filter/steps.h"

namespace pirt::slam {

struct RecordingOptions {
  std::uint64_t path_seed = 1, room_seed = 1;
  double duration_s = 6.0, rest_s = 1.5;  ///< Of the rest at the start.
};

/// A function of its options. Immutable.
class Recording {
 public:
  static constexpr double kFrame_s = 0.04;
  static constexpr int kSamplesPerFrame = 8;

  explicit Recording(const RecordingOptions& options = {});

  [[nodiscard]] const Setup& setup() const { return setup_; }
  [[nodiscard]] Nanos time_of(int frame) const { return from_s((frame + 1) * kFrame_s); }
  /// The body in the world of the filter, which begins at the start, level, heading along x.
  [[nodiscard]] Pose truth_at(int frame) const;

  /// All that its camera may see, in the same world.
  [[nodiscard]] std::vector<Eigen::Vector3d> points() const;

  /// Samples that arrive between the frame before and this one, the last at its time.
  [[nodiscard]] std::vector<ImuSample> samples(int frame) const;
  /// Corners of the points in view. @param noise  Seeds what they are off by.
  [[nodiscard]] Features features(int frame, std::uint64_t noise) const;
  /// Where the state's tracks of the frame before are: each is a feature's of some frame before.
  [[nodiscard]] FrameTracks tracks(const State& state, int frame, std::uint64_t noise) const;

 private:
  struct Point {
    Eigen::Vector3d position;
    Descriptor descriptor;
  };
  [[nodiscard]] Pose start() const;  ///< Of the filter's world in the room.
  [[nodiscard]] std::optional<Eigen::Vector2d> seen(std::size_t point, int frame) const;

  std::uint64_t seed_;
  Setup setup_;
  RobotPath path_;
  std::vector<Point> points_;
};

/// The state before each step of one frame, and what came in.
struct Moment {
  int frame = 0;
  State before_propagate, before_update, before_extend;
};
/// Plays the recording to @p frame.
[[nodiscard]] Moment moment_of(const Recording& recording, int frame);

}  // namespace pirt::slam
