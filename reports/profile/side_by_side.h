// Several profiles in one report: boards beside each other, or versions of one.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "characterize/profile/profile.h"
#include "reports/document/chart.h"
#include "reports/document/document.h"

namespace pirt {

/// What each is called: its file's name, with the run and platform where two files have one name.
[[nodiscard]] std::vector<std::string> names_of(std::span<const Profile> profiles);

/// Which they are, and what they were measured under differs in: rows that differ in a fact of the
/// identity do not compare as versions of one machine (`pirt diff`, `pirt regress`).
[[nodiscard]] Table identities_table(std::span<const Profile> profiles);

/// Time a call: a row a workload, unit and profile, with what it takes of the first profile's.
[[nodiscard]] Chart side_by_side_chart(std::span<const Profile> profiles);

/// The best unit of each workload in each profile, by time and by energy.
[[nodiscard]] Table best_units_table(std::span<const Profile> profiles);

}  // namespace pirt
