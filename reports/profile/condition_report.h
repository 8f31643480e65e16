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
/// What units take beside their calls; absent without rows.
[[nodiscard]] std::optional<Table> unit_time_table(const Profile& profile);
/// Those of both that are there.
[[nodiscard]] std::vector<Table> condition_tables(const Profile& profile);

/// Rows with the columns of view unit_time_summary.
[[nodiscard]] Json unit_time_json(const Profile& profile);

}  // namespace pirt
