// Durations, percentages and watts as they are typed on the command line.
#pragma once

#include <string>

#include "workloads/base/time.h"

namespace pirt::cli {

/// "60s", "500ms", "2min", "1h"; a bare number is seconds. @throws Error{kBadInput} unless positive
/// and at most 10 years.
[[nodiscard]] Nanos parse_duration(const std::string& text);

/// "2%" or "0.02" -> 0.02. @throws Error{kBadInput} unless within (0, 1].
[[nodiscard]] double parse_fraction(const std::string& text);

/// "11W", "800mW"; a bare number is watts. @throws Error{kBadInput} unless positive and at most 1
/// MW.
[[nodiscard]] double parse_watts(const std::string& text);

}  // namespace pirt::cli
