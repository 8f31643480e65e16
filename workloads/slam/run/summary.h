// What a run over a sequence amounts to: rate, latencies, errors.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "workloads/slam/run/pipeline.h"

namespace pirt::slam {

struct StageSummary {
  std::string name;
  double mean_ms = 0, p50_ms = 0, p95_ms = 0, p99_ms = 0;
};

/// @param ms  In any order.
[[nodiscard]] StageSummary summary_of(std::string name, std::vector<double> ms);

/// Of the turn from a frame to one after it, mean.
struct TurnError {
  std::size_t frames = 1;  ///< How many after it.
  double mean_deg = 0;
  double trivial_deg = 0;  ///< What no turn at all scores.
};

/// What became of the setup's known map.
struct KnownMapSummary {
  std::size_t points = 0;
  std::optional<double> found_after_s;  ///< From the first frame; absent = it was not found.
};

struct RunSummary {
  std::size_t frames = 0;
  std::size_t starting = 0, tracking = 0, lost = 0;  ///< Frames by status.
  std::size_t unusable = 0;                          ///< Pictures without contrast.
  double rate_hz = 0;  ///< Frames over the time of all stages; reading pictures is not in it.
  std::vector<StageSummary> stages;      ///< And "frame", their sum.
  std::optional<TrajectoryError> error;  ///< With truth, over the frames that have a pose.
  /// Beside it: the last step repeated for ever (two poses of the truth, no sensor).
  std::optional<double> constant_velocity_ate_rms_m;
  std::vector<TurnError> turns;  ///< Over 1 frame and over 10, where so many have a pose and truth.
  bool scale_known = true;       ///< Aligned by SE(3); otherwise by Sim(3).
  std::size_t landmarks = 0, map_points = 0;
  MapChange map_change;                      ///< By what was known better, all together.
  std::optional<KnownMapSummary> known_map;  ///< Where there is one.
};

[[nodiscard]] RunSummary summarize(const Sequence& sequence, const RunResult& result,
                                   const Setup& setup);

}  // namespace pirt::slam
