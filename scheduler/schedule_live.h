// Schedules a mix on a platform live: as schedule.h, by the machine's clock.
#pragma once

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "scheduler/mix/mix.h"
#include "scheduler/policies/setup.h"
#include "scheduler/record/run_record.h"
#include "scheduler/runtime/live_run.h"

namespace pirt {

/// With real kernels on units that have a backend; see runtime/live_run.h.
/// @throws As run_virtual, and Error{kEnvironment} for a device that cannot be opened.
[[nodiscard]] RunRecord run_live(const Platform& platform, const Profile* profile, const Mix& mix,
                                 const ScheduleOptions& options, const LiveOptions& live);

}  // namespace pirt
