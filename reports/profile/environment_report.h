// What is known of a run besides its figures: the identity that has to match for comparing, and the
// rest.
#pragma once

#include "characterize/profile/profile.h"
#include "reports/document/document.h"

namespace pirt {

/// Every recorded fact of the newest run, identity first, each with its value or why it is not
/// known.
[[nodiscard]] Table environment_table(const Profile& profile);

}  // namespace pirt
