// A trace as one value, also where a formatter or an older pirt has laid its file out: for readers
// to whom memory is no matter.
#pragma once

#include <string>

#include "workloads/base/text/json.h"

namespace pirt {

/// {"traceEvents": [EVENT, ...], "pirt": {HEADER, "inputs": N, "log": [ENTRY, ...]}}. Of a
/// file (trace_file.h) that ends in the middle, "inputs" is null and the last line, if torn, left
/// out.
/// @throws JsonError for what is no JSON, and none that ends in the middle of such lines;
/// Error{kBadInput} for what is not a trace of pirt's.
[[nodiscard]] Json parse_trace(const std::string& text);

}  // namespace pirt
