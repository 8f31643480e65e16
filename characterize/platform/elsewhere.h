// Units that compute elsewhere: what of their calls is the robot's.
#pragma once

#include "characterize/platform/platform.h"
#include "workloads/model/phase.h"

namespace pirt {

/// Whether its calls are computed elsewhere, and only what they move is the robot's.
[[nodiscard]] inline bool is_elsewhere(const UnitModel& unit) {
  return unit.measured() && unit.role == Role::kCloud;
}

/// Whether active_w is drawn in that phase of a call: elsewhere, by the radio while it sends and
/// receives.
[[nodiscard]] inline bool draws_in(const UnitModel& unit, Phase phase) {
  return !is_elsewhere(unit) || phase == Phase::kUpload || phase == Phase::kDownload;
}

}  // namespace pirt
