// From what a run counted to its record: rates, percentiles, energy.
#pragma once

#include "characterize/profile/profile.h"
#include "scheduler/policies/policy.h"
#include "scheduler/record/run_record.h"
#include "scheduler/record/tally.h"
#include "scheduler/services/scenario.h"

namespace pirt {

/// Everything but what the caller chose: mode, basic, overflow and warnings are left to it.
[[nodiscard]] RunRecord summarize(const Scenario& run, const Profile* profile,
                                  const WeightTable& weights, const Tally& tally);

}  // namespace pirt
