// What a call takes beside the figure of calls in a row: with cold caches, beside a busy unit, and
// until it begins.
#pragma once

#include <optional>
#include <vector>

#include "characterize/profile/profile.h"
#include "reports/document/document.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// `execute` under each condition; absent without rows of any but steady.
[[nodiscard]] std::optional<Table> condition_table(const Profile& profile);
/// From handing a call to a unit until it begins, by how long the unit slept; absent without rows.
[[nodiscard]] std::optional<Table> handover_table(const Profile& profile);
/// Those of both that are there.
[[nodiscard]] std::vector<Table> condition_tables(const Profile& profile);

/// Rows with the columns of view handover_summary.
[[nodiscard]] Json handover_json(const Profile& profile);

}  // namespace pirt
