// What `pirt characterize` says of its plan and of what came of it.
#pragma once

#include <string>

#include "characterize/campaign/campaign.h"
#include "characterize/profile/store/reader.h"
#include "workloads/base/text/json.h"

namespace pirt::cli {

/// What measures the same again, from any folder, but for the database.
[[nodiscard]] std::string command_of(const CampaignOptions& campaign);
[[nodiscard]] std::string progress_text(const Progress& progress);
[[nodiscard]] Json plan_json(const CampaignPlan& plan);
[[nodiscard]] std::string plan_text(const CampaignPlan& plan, const CampaignOptions& campaign);
/// Why no row of a call has a figure.
[[nodiscard]] std::string nothing_text(const Profile& profile);
/// What the time did not suffice for, and what to do; "" if it did.
[[nodiscard]] std::string out_of_time_text(const CampaignSummary& summary, const CampaignPlan& plan,
                                           const std::string& database);
[[nodiscard]] std::string summary_text(const CampaignSummary& summary, const CampaignPlan& plan,
                                       const CampaignOptions& campaign);
/// What to do where less than half of the cells became precise; "" elsewhere, and after --quick,
/// which does not try to.
[[nodiscard]] std::string precision_text(const CampaignSummary& summary, const CampaignPlan& plan,
                                         const CampaignOptions& campaign);
/// What to do about rows that are uncertain: those of their workloads again, with the same inputs.
[[nodiscard]] std::string doubted_text(const Profile& profile, const CampaignOptions& campaign);
/// What the clock does to a sample: batches keep it below 0.1 % of any phase (measure.h).
[[nodiscard]] std::string clock_text(const RunInfo& run);
[[nodiscard]] Json summary_json(const CampaignSummary& summary);

}  // namespace pirt::cli
