// The file of a trace (trace_file.h) as readers want it, also where a formatter or an older pirt
// has laid it out: as one value, where memory is no matter, or its log entry by entry.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "scheduler/trace/log_json.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// {"traceEvents": [EVENT, ...], "pirt": {HEADER, "inputs": N, "log": [ENTRY, ...]}}. Of a
/// file that ends in the middle, "inputs" is null and the last line, if torn, left out.
/// @throws JsonError for what is no JSON, and none that ends in the middle of such lines;
/// Error{kBadInput} for what is not a trace of pirt's.
[[nodiscard]] Json parse_trace(const std::string& text);

/// What stands beside the entries of a log.
struct LogFile {
  DispatcherSetup setup;
  std::optional<std::size_t> size;  ///< Of the log; absent if that was not read to its end.
  bool complete = true;             ///< False: the end is missing.
};
/// @return  Whether it wants more.
using TakeEntry = std::function<bool(const DispatcherSetup& setup, LogEntry entry)>;
/// In memory that does not follow the file's length, unless that is laid out otherwise than pirt
/// does.
/// @throws Error{kBadInput} naming the file: not there, not a trace of pirt's, another version, an
/// entry that makes no sense, more or fewer of them than it says; and what @p take throws.
[[nodiscard]] LogFile read_log(const std::filesystem::path& path, const TakeEntry& take);

}  // namespace pirt
