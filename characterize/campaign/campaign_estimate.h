// How long a campaign takes: from what an earlier run found where there is one.
#pragma once

#include "characterize/campaign/campaign.h"
#include "characterize/worker/measure.h"

namespace pirt {

/// Processes of one cell that valid rows need.
[[nodiscard]] int needed_processes(const CampaignOptions& options);

/// What one process of each kind samples.
[[nodiscard]] SamplingOptions sampling_options(const CampaignOptions& options);

/// Peaks, meters and times of units.
[[nodiscard]] Nanos time_beside_cells(const CampaignPlan& plan);

/// From the figures that options.database has of the plan's cells (set-up, calls, how many
/// processes the last run took for its precision); from constants for cells that it does not have,
/// or if it is missing or no profile database, which is not for an estimate to refuse. Without what
/// an unfinished run has done.
[[nodiscard]] Estimate estimate(const CampaignOptions& options, const CampaignPlan& plan);

}  // namespace pirt
