// `pirt run-robot`: one run over a sequence, or several drivers side by side.
#pragma once

#include <span>
#include <string>

#include "reports/table.h"
#include "scheduler/robot/localization.h"
#include "workloads/base/json.h"
#include "workloads/slam/summary.h"

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
};
/// @param driver  As RobotRun::driver.
[[nodiscard]] RobotRun robot_run(std::string driver, std::string mode, const Sequence& sequence,
                                 const LocalizationOptions& options, LocalizationResult result);

[[nodiscard]] std::string robot_text(const RobotRun& run);
/// @param dataset  As the command was given it.
[[nodiscard]] Json robot_json(const RobotRun& run, const std::string& dataset);

/// A row a run.
[[nodiscard]] Table robot_comparison(std::span<const RobotRun> runs);

}  // namespace pirt
