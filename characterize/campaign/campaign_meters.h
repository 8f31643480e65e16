// The energy meters of a campaign: which unit's energy is read from which, how long that takes, and
// what they show before anything is measured.
#pragma once

#include "characterize/campaign/campaign.h"

namespace pirt {

/// Fills in plan.meters, plan.remarks and the facts "meter.UNIT" of plan.units.
/// @throws Error as choose_meters.
void plan_meters(const CampaignOptions& options, CampaignPlan& plan);

/// What metering adds to the campaign, of a cell of @p unit and of all: repeats of three windows
/// (metered_calls.h), beside what a board's process takes.
[[nodiscard]] Nanos metering_time(const CampaignPlan& plan, const std::string& unit);
[[nodiscard]] Nanos metering_time(const CampaignPlan& plan);

/// The machine's power before the first cell, while no device is open, by each unit's meter:
/// "meter.UNIT.idle_w". Takes a window a meter, and of a GPU's until it is at rest.
[[nodiscard]] Environment idle_facts(const CampaignPlan& plan);

/// The median power of a GPU that is open and idle: "meter.UNIT.awake_w".
/// @param idle_w  By unit: what its cells' meterings had before their calls.
[[nodiscard]] Environment awake_facts(const CampaignPlan& plan,
                                      const std::map<std::string, std::vector<double>>& idle_w);

}  // namespace pirt
