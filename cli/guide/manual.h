// Manual pages, from the table that --help is printed from.
#pragma once

#include <string>
#include <vector>

#include "cli/options/program.h"

namespace pirt::cli {

/// Of the program, its commands and their kinds: "pirt", "pirt-generate", "pirt-generate-dag".
[[nodiscard]] std::vector<std::string> manual_names(const CommandDescription& program);

/// A page of man(7).
/// @throws Error{kBadInput} with the nearest names for a page that there is not.
[[nodiscard]] std::string manual_page(const CommandDescription& program, const std::string& name,
                                      const std::string& version);

}  // namespace pirt::cli
