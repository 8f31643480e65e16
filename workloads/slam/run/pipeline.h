// A whole sequence, frame after frame, in one thread: the reference that a live run is compared
// with.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "workloads/inputs/sequence/trajectory.h"
#include "workloads/slam/filter/steps.h"

namespace pirt::slam {

enum class Stage : std::uint8_t {
  kPropagate,
  kPyramid,
  kExtract,
  kTrack,
  kTrackRight,
  kUpdate,
  kExtend,
};
inline constexpr std::array kStages = {Stage::kPropagate, Stage::kPyramid,    Stage::kExtract,
                                       Stage::kTrack,     Stage::kTrackRight, Stage::kUpdate,
                                       Stage::kExtend};
[[nodiscard]] std::string_view to_string(Stage stage);

/// What came out of one frame.
struct FrameResult {
  StampedPose pose;
  Status status = Status::kStarting;
  bool in_map = false;  ///< The pose is in the world of the setup's known map.
  Eigen::Matrix3d position_covariance = Eigen::Matrix3d::Zero();
  FrameReport report;
  MapChange map_change;
  bool unusable = false;  ///< The picture was black or constant.
  std::array<Nanos, kStages.size()> stage_time{};
};

/// What becomes of a frame.
enum class Next : std::uint8_t {
  kTake,
  kDrop,  ///< As if there had been none.
  kStop,  ///< Nor are those after it taken.
};

struct RunOptions {
  Setup setup;
  const Clock* clock = nullptr;  ///< For stage_time; none = they are 0.
  /// Called after each frame, with its left picture (for plots).
  std::function<void(std::size_t frame, const State&, const GreyImage&, const FrameResult&)> seen;
  /// Pictures may be replaced before they are used (tests of bad frames).
  std::function<void(std::size_t frame, std::size_t camera, GreyImage&)> spoil;
  /// Asked before each frame, whose pictures have been read; empty = each is taken.
  std::function<Next(std::size_t frame)> next;
  /// Asked in each frame for points of the map that are known better; empty = there are none.
  std::function<BetterMap()> better_map = {};
};

struct RunResult {
  std::vector<FrameResult> frames;
  State last;
  std::size_t left_out = 0;  ///< Frames whose left picture could not be read.

  /// The poses since there is one, all in the last one's world.
  [[nodiscard]] std::vector<StampedPose> trajectory() const;
};

/// Without contrast nothing can be followed, and noise must not be taken for corners.
[[nodiscard]] bool is_blank(const GreyImage& image);

/// IMU samples from just before @p from to just after @p until.
/// @param from  Zero = of a state that has not begun: half a second before @p until.
[[nodiscard]] std::span<const ImuSample> samples_between(const Sequence& sequence, Nanos from,
                                                         Nanos until);

/// The setup that a sequence needs: its cameras and its IMU.
[[nodiscard]] Setup setup_of(const Sequence& sequence);

[[nodiscard]] RunResult run_serially(const Sequence& sequence, const RunOptions& options);

}  // namespace pirt::slam
