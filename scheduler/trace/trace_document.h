// A trace as one value, whichever way its file is laid out: for readers to whom memory is no
// matter.
#pragma once

#include <string>

#include "workloads/base/text/json.h"

namespace pirt {

/// {"traceEvents": [EVENT, ...], "pirt": {HEADER, "inputs": N, "log": [ENTRY, ...]}}. Of lines
/// (trace_file.h) that end in the middle, "inputs" is null and the last line, if torn, left out.
/// @throws JsonError for what is no JSON, and none that ends in the middle of such lines;
/// Error{kBadInput} for what is not a trace of pirt's.
[[nodiscard]] Json parse_trace(const std::string& text);

}  // namespace pirt
