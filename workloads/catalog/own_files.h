// Files of workloads that are somebody else's, taken into this process.
#pragma once

#include <filesystem>
#include <vector>

#include "workloads/own/definition.h"

namespace pirt {

/// Loads a file (workloads/own/own.h) and makes known (own_list.h) what it has: from then on this
/// process can compute it.
/// @return  What it has, at least one.
/// @throws Error as own::load.
std::vector<own::Definition> load_workloads(const std::filesystem::path& file);

}  // namespace pirt
