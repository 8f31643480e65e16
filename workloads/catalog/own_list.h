// Workloads that are somebody else's, made known to this process: beside those of the catalog, and
// found by name as they are.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "workloads/model/workload.h"

namespace pirt {

/// From now on they are found by their names, in place of what had them before, which whoever has
/// found it keeps. Any thread.
void make_known(std::vector<Workload> workloads);

/// Null if there is none of that name. Stays to the end of the process.
[[nodiscard]] const Workload* try_find_own(std::string_view name);

/// For whoever is to compute it: of a profile alone one knows only what it is.
/// @throws Error{kBadInput} with the file to load, if its code is not here.
void check_code_is_here(const Workload& workload);

/// As they are found, in the order in which their names came.
[[nodiscard]] std::vector<const Workload*> own_workloads();

}  // namespace pirt
