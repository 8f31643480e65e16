// Which of what virtual time adds to a call explains that a live run's calls took longer than their
// row.
#pragma once

#include <string>

#include "characterize/profile/profile.h"
#include "reports/run/live_report.h"

namespace pirt {

/// Of a row that is contradicted: "cold caches", "cold caches and a busy neighbour", "its data", or
/// what else; empty for others.
[[nodiscard]] std::string explanation_of(const RowCheck& check, const Profile& profile);

/// What a prediction with @p profile leaves out that a live run has. @param profile  May be null.
[[nodiscard]] std::string left_out_of_prediction(const Profile* profile);

}  // namespace pirt
