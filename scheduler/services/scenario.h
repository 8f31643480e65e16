// What is run, and on what: one value for planners, bounds, virtual time and what is written of it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "scheduler/mix/mix.h"
#include "scheduler/mix/task.h"
#include "scheduler/services/eligibility.h"
#include "scheduler/services/faults.h"
#include "scheduler/services/services.h"
#include "workloads/base/time.h"

namespace pirt {

/// Its platform and mix must outlive it.
struct Scenario {
  const Platform& platform;
  const Mix& mix;
  ServiceTable services;
  std::vector<std::vector<TaskClass>> classes;  ///< [pipeline][task]
  std::vector<int> in_flight = {};  ///< By pipeline; >= 1 where it is a closed loop, else 0.
  /// With an open loop: nothing fires from then on, and counts and energy are those of that moment.
  /// What has fired is finished all the same, so that the rest of it is known.
  Nanos duration{0};
  std::uint64_t seed = 1;
  std::optional<Faults> faults = {};  ///< Absent = every call completes.
  bool slices = false;                ///< Calls are suspended where their workloads say so.

  /// From now on none is.
  void keep_calls_whole();
};

/// Services and classes of the mix's tasks; the rest is left to the caller.
/// @param profile    Null = only what the platform file says.
/// @param options    `given` is filled in from the mix.
/// @param cloud_use  What the mode gives to the cloud.
/// @throws Error{kBadInput}: a task that no unit (or none that the mode uses) can serve, with each
/// unit's reason and the command that measures it; `eligible` that names nothing; a profile of
/// another platform.
[[nodiscard]] Scenario make_scenario(const Platform& platform, const Profile* profile,
                                     const Mix& mix, ServiceOptions options, CloudUse cloud_use);

}  // namespace pirt
