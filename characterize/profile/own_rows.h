// Rows of workloads that are not pirt's: a run keeps what they are, so that who schedules with its
// profile needs no code of theirs.
#pragma once

#include <map>
#include <set>
#include <string>
#include <string_view>

#include "characterize/profile/profile.h"
#include "workloads/model/workload.h"

namespace pirt {

/// What a fact of a run begins with that says what a workload is; its name follows.
inline constexpr std::string_view kOwnFact = "workload.";
/// The fact of a run that says what @p workload is; none for pirt's own.
[[nodiscard]] std::map<std::string, std::string> own_facts(const Workload& workload);

/// Makes known (catalog/own_list.h) what the profile's runs say of workloads, the newest first;
/// what this process knows already stays.
/// @throws Error{kBadInput} naming the run whose fact is none.
void learn_workloads(const Profile& profile);

/// A doubt of rows: their code was built anew since they were measured.
inline constexpr const char* kChanged = "changed";

/// The workloads that the profile has measured of @p file, or of one that held the same elsewhere,
/// and of no other since.
[[nodiscard]] std::set<std::string> measured_of(const Profile& profile, const std::string& file,
                                                const std::string& digest);

/// Doubts the rows of those of @p workloads that were measured of a file with another digest.
/// @param workloads  Without sizes: "mine.sobel".
/// @return  The rows' workloads, with commas; empty = they are what was measured.
std::string doubt_changed(Profile& profile, const std::set<std::string>& workloads,
                          const std::string& digest);
/// The same of rows that were measured of another file than the newest run's of their workload.
void doubt_older(Profile& profile);

}  // namespace pirt
