// Which program this is.
#pragma once

#include <string>

namespace pirt::cli {

/// Version, commit, compiler and backends, a line each.
[[nodiscard]] std::string version_text();

}  // namespace pirt::cli
