// What a profile says, as tables: the figures of each cell, and the preferable unit for each
// workload.
#pragma once

#include <string>
#include <vector>

#include "characterize/profile/profile.h"
#include "reports/document/document.h"
#include "reports/profile/preference.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// Where and when it was measured, and on what device each unit computes.
[[nodiscard]] Paragraph profile_header(const Profile& profile);

/// A row for each workload and unit: call, execution, transfers, set-up, energy, remarks.
[[nodiscard]] Table profile_table(const Profile& profile);

/// This machine's Table III, beside the paper's.
/// @param with_paper  With the units that the paper's Table III prefers.
[[nodiscard]] Table preference_table(const std::vector<Preference>& preferences,
                                     bool with_paper = false);

/// Units best first, each with its figure under @p value_key; the preferable one, and by how much.
[[nodiscard]] Json ranking_json(const Ranking& ranking, const char* value_key);

/// What that table is made of: "by_time" in ms, "by_energy" in J a call.
[[nodiscard]] Json preference_json(const std::vector<Preference>& preferences);

/// Everything that the tables are made of, in the units of the names.
[[nodiscard]] Json profile_json(const Profile& profile, const std::vector<Preference>& preferences);

}  // namespace pirt
