// Estimated trajectories: their text form, and how far they are from the truth.
//
// @source  Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems, IROS 2012 (ATE, RPE,
// the TUM format); Umeyama, PAMI 1991 (alignment).
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "workloads/inputs/sequence/sequence.h"

namespace pirt {

struct StampedPose {
  Nanos time{};
  Pose body;  ///< body -> world of the estimate.
};

/// "seconds tx ty tz qx qy qz qw" a line, with a comment on top.
[[nodiscard]] std::string tum_text(std::span<const StampedPose> trajectory);

/// The rows of such a file. What does not rise is left out with a warning.
/// @throws Error{kBadInput} with file:line.
[[nodiscard]] std::vector<TruthRow> read_tum(const std::filesystem::path& file,
                                             std::vector<std::string>& warnings);

/// Reads truth that nobody has named: it is to evaluate only, and what is none costs a warning, not
/// the sequence.
void take_truth(Sequence& sequence, const std::string& what, const std::function<void()>& read);

/// Truth that was lost for longer is not made up.
inline constexpr Nanos kLongestTruthGap = std::chrono::milliseconds(300);
/// Truth at @p time, between its rows; absent outside of them.
[[nodiscard]] std::optional<Pose> truth_at(std::span<const TruthRow> truth, Nanos time);

enum class Alignment : std::uint8_t {
  kSe3,       ///< Rotation and translation: the scale has to be right.
  kSim3,      ///< And scale: a single camera does not know it.
  kStartYaw,  ///< Position and heading of the first pose: what a filter's covariance is about.
};

struct Similarity {
  double scale = 1.0;
  Pose pose;
  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& p) const;
};

/// A pose of a world that is @p similarity away.
[[nodiscard]] Pose moved(const Similarity& similarity, const Pose& pose);

/// Whether 3 poses have truth, by which it can be aligned.
[[nodiscard]] bool can_align(std::span<const StampedPose> estimate,
                             std::span<const TruthRow> truth);
/// Of estimate to truth, by the poses that have truth.
/// @throws Error{kBadInput} unless can_align() (of kStartYaw if none has).
[[nodiscard]] Similarity align(std::span<const StampedPose> estimate,
                               std::span<const TruthRow> truth, Alignment alignment);

struct TrajectoryError {
  std::size_t poses = 0;  ///< With truth.
  double path_m = 0;      ///< Of the truth over the estimate's time.
  double ate_rms_m = 0;   ///< After alignment.
  double ate_max_m = 0;
  /// Of the aligned attitude. Absent if the positions do not tell how to turn the whole: they are
  /// off by no less than they lie beside a line.
  std::optional<double> rotation_error_mean_deg;
  double scale = 1.0;
};

[[nodiscard]] TrajectoryError evaluate(std::span<const StampedPose> estimate,
                                       std::span<const TruthRow> truth, Alignment alignment);

/// Mean angle between estimated and true rotation from frame i to frame i + @p step; no alignment
/// is involved. Absent if there are no such pairs.
[[nodiscard]] std::optional<double> relative_rotation_error_deg(
    std::span<const StampedPose> estimate, std::span<const TruthRow> truth, std::size_t step);

}  // namespace pirt
