// The steps of one frame, in their order. Each is a function of the state, the setup and what its
// ports bring; the pipeline (serial or live) only passes values between them.
//
//   imu ──► imu_propagate ─────────────┐
//   image ─► extract_features ─┬──────►│ update_pose ──► extend_map ──► state
//        └─► track_features ───┴──────►│
#pragma once

#include <span>
#include <string>
#include <vector>

#include "workloads/slam/filter/map_points.h"
#include "workloads/slam/filter/state.h"
#include "workloads/vision/pyramid.h"

namespace pirt::slam {

/// Sets the filter up from the start at rest; what the state still lacks then stays kStarting.
/// Called once a frame until the state tracks; adds @p samples to those that wait.
/// With an IMU: level from the mean force, bias from the mean turn. A start that moves takes a wide
/// prior (a single camera with IMU may not recover from that). Without an IMU the filter starts
/// from the first frames that have a base line (see start_from_tracks).
void start(State& state, const Setup& setup, std::span<const ImuSample> samples, Nanos time);

/// The first step of a frame at @p time: the start as long as there is no pose, else the motion.
void begin_frame(State& state, const Setup& setup, std::span<const ImuSample> samples, Nanos time);
/// Whether pictures say something to the state: not before an IMU has set it up.
[[nodiscard]] bool sees(const State& state, const Setup& setup);

/// What track_features needs: tracks' pixels, and where the moved state expects them.
struct TrackRequest {
  std::vector<Eigen::Vector2f> pixels;   ///< f32 [n,2], previous picture.
  std::vector<Eigen::Vector2f> guesses;  ///< f32 [n,2]
};
[[nodiscard]] TrackRequest request_tracks(const State& state, const Setup& setup);
/// The same from the left picture to the right one.
/// @param depths  Of the tracks, as they have them; f64 [n].
[[nodiscard]] TrackRequest request_right(const Setup& setup, std::span<const double> depths,
                                         std::span<const TrackedPoint> left);
[[nodiscard]] std::vector<double> depths_of(const State& state);

struct FrameTracks {
  std::vector<TrackedPoint> left;   ///< By track of the state.
  std::vector<TrackedPoint> right;  ///< By track; empty without a second picture.
};

/// What happened in a frame, for statistics and pictures.
struct FrameReport {
  int tracks = 0;      ///< Followed into this frame.
  int landmarks = 0;   ///< Of the filter that were used.
  int recognized = 0;  ///< Of those, known again by their descriptors.
  int points = 0;      ///< Tracks that ended and were used.
  int rejected = 0;    ///< Measurements that were no inliers.
  int from_map = 0;    ///< Of those recognized, points of a map, which had left the filter.
  /// Of those followed, so near that two cameras tell how far they are; 0 by sees_stereo().
  int stereo = 0;
};

/// Corrects the state by what was followed and what is known again. Adds a clone of the pose.
/// Robust by gates and by PnP with RANSAC over the landmarks.
FrameReport update_pose(State& state, const Setup& setup, const FrameTracks& tracks,
                        const Features& features);

/// Corrects the state by whole tracks, each of which says something of the clones that saw it.
/// Tracks that do not fit have depth -1 then; those of landmarks and short ones are taken out.
void use_points(State& state, const Setup& setup, std::vector<Track>& ended, std::size_t most,
                FrameReport& report);
inline constexpr std::size_t kMostPoints = 30;  ///< In one frame: what bounds its time.

/// Triangulates: tracks with a good base line become landmarks or map points, new corners become
/// tracks, what exceeds the setup's bounds is forgotten, and points of the map that are known
/// better take the place of those that it has. Does nothing before the first update_pose.
MapChange extend_map(State& state, const Setup& setup, const Features& features,
                     const BetterMap& better = {});

/// Points that two cameras tell the unit of length by.
inline constexpr std::size_t kLeastStereo = 20;
/// Whether enough of the points that are followed are found in the second picture. Where pictures
/// are taken for each other's 7 % are, by chance (EuRoC's cameras), and seem to be near.
[[nodiscard]] constexpr bool sees_stereo(std::size_t found, std::size_t followed) {
  return 4 * found >= followed;
}

/// Without an IMU: takes the first frames that have a base line as the start. Its length is that
/// by kLeastStereo depths of two cameras, else of a unit that nobody knows.
/// @return  Whether the state tracks now.
bool start_from_tracks(State& state, const Setup& setup);

/// Finds the pose again from landmarks and map points that look like @p features, by PnP.
/// @return  Whether it did; the state's poses are then new, with a covariance that says how well
/// they are known.
bool relocalize(State& state, const Setup& setup, const Features& features);

}  // namespace pirt::slam
