// Going on with a campaign that did not end: what is stored of its options, and what must not have
// changed meanwhile.
#pragma once

#include <string>

#include "characterize/campaign/campaign.h"

namespace pirt {

/// Options and cells as JSON, for RunHeader::plan.
[[nodiscard]] std::string stored_plan(const CampaignOptions& options, const CampaignPlan& plan);

/// Leaves in @p plan the cells that the stored plan has and that are not done yet.
/// @throws Error{kEnvironment}: one of them cannot be measured any more (with the reason).
void restrict_to_stored(const UnfinishedRun& run, CampaignPlan& plan);

/// @throws Error{kBadInput} if facts that must match for runs to be comparable (fact_kind) are not
/// those of @p run, or the program is another: names them.
void check_identity(const RunInfo& run, const Environment& facts);

}  // namespace pirt
