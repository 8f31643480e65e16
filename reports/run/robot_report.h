// `pirt run-robot`: one run over a sequence, or several drivers side by side.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "reports/document/table.h"
#include "scheduler/robot/activities.h"
#include "scheduler/robot/localization.h"
#include "workloads/base/text/json.h"
#include "workloads/slam/run/summary.h"

namespace pirt {

/// What one driver did, as it is shown.
struct RobotRun {
  std::string driver;  ///< "serial, without the runtime", "live, mode ect on host".
  std::string mode;    ///< Empty without the runtime.
  bool own_rate = true;
  slam::Setup setup;
  slam::RunSummary summary;    ///< Of the frames that were localized; its rate is the driver's.
  slam::StageSummary latency;  ///< From a frame's arrival to its pose.
  LocalizationResult result;
  std::vector<ActivityCounts> activities;  ///< What else it did.
  Plans plans = {};
  std::vector<std::string> scenes = {};  ///< As Activities::scenes().
  std::optional<Pose> map_from_world = {};
  /// Of the keyframes, before they were adjusted and after; absent without truth.
  std::optional<TrajectoryError> keyframes_before, keyframes_after;
  double energy_j = 0;  ///< By the platform's watts; 0 = not known.
  Provenance watts = Provenance::kModelled;
};
/// @param driver      As RobotRun::driver.
/// @param activities  Null = it only localized.
[[nodiscard]] RobotRun robot_run(std::string driver, std::string mode, const Sequence& sequence,
                                 const LocalizationOptions& options, LocalizationResult result,
                                 const Activities* activities);

[[nodiscard]] std::string robot_text(const RobotRun& run);
/// @param dataset  As the command was given it.
[[nodiscard]] Json robot_json(const RobotRun& run, const std::string& dataset);

/// A row a run.
[[nodiscard]] Table robot_comparison(std::span<const RobotRun> runs);

}  // namespace pirt
