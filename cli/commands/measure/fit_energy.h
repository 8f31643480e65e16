// `pirt characterize --fit-energy`: the energy model fitted to the run's meters, as tables and as a
// platform file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "characterize/campaign/campaign.h"
#include "characterize/energy/fit.h"
#include "characterize/profile/profile.h"
#include "cli/options/output.h"
#include "reports/document/document.h"
#include "workloads/base/text/json.h"

namespace pirt::cli {

struct FitOptions {
  Output file;                            ///< Where the platform goes; absent = no fit.
  std::optional<std::string> parameters;  ///< "active_w,op_pj"; absent = what the cells tell apart.
};

/// Before anything is measured: @throws Error{kBadInput} for a file name that --platform would not
/// take for a file, or bad parameters; Error{kEnvironment} if no unit of the plan has a meter.
void check_fit(const FitOptions& options, const CampaignPlan& plan);

struct FitOutcome {
  std::vector<Table> tables;
  Json json;
  bool complete = false;  ///< Every unit with a meter was fitted.
};

/// Fits, and writes the file unless no unit could be fitted.
[[nodiscard]] FitOutcome fit_run(const FitOptions& options, const CampaignOptions& campaign,
                                 const Profile& profile);

}  // namespace pirt::cli
