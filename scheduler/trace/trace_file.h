// The file of a trace: Chrome's JSON, which Perfetto opens, and behind it pirt's own part.
//
//   {"displayTimeUnit": "ms", "traceEvents": [EVENT, ...], "pirt": {..., "log": [ENTRY, ...]}}
//
// Events and log entries come interleaved and are two lists, so that the log is collected in a
// second file. Nothing is kept in memory. The trace appears under its name when it is complete, and
// not at all if it does not become so.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "workloads/base/text/json.h"

namespace pirt {

class TraceFile {
 public:
  /// @throws Error{kBadInput} if nothing can be written there.
  explicit TraceFile(std::filesystem::path path);
  /// Leaves nothing behind unless finished.
  ~TraceFile();
  TraceFile(const TraceFile&) = delete;
  TraceFile& operator=(const TraceFile&) = delete;

  // A write that fails shows in finish().

  /// @param json  One event, or one log entry, as JSON.
  void event(std::string_view json);
  void log(std::string_view json);
  /// @param header  What stands beside "log" under "pirt": an object.
  /// @throws Error{kBadInput} if something could not be written; the trace is then not there, and a
  /// file that was under its name before is as it was.
  void finish(const Json& header);

 private:
  [[noreturn]] void fail() const;

  std::filesystem::path path_, events_path_, log_path_;
  std::ofstream events_, log_;
  std::int64_t events_count_ = 0, log_count_ = 0;
};

}  // namespace pirt
