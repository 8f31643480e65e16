// What is known of a run besides its figures: the identity that has to match for comparing, and the
// rest.
#pragma once

#include <nlohmann/json.hpp>

#include "characterize/profile.h"
#include "reports/document.h"

namespace pirt {

/// Every recorded fact of the newest run, identity first, each with its value or why it is not
/// known.
[[nodiscard]] Table environment_table(const Profile& profile);

/// {"identity": {field: value}, "information": {...}, "unknown": {field: why}} of one run.
[[nodiscard]] nlohmann::ordered_json environment_json(const RunInfo& run);

}  // namespace pirt
