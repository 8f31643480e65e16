// The file of a trace: Chrome's JSON, which Perfetto opens, and behind it pirt's own part.
//
//   {"displayTimeUnit": "ms", "traceEvents": [EVENT, ...], "pirt": {..., "log": [ENTRY, ...]}}
//
// Events and log entries come interleaved and are two lists, so that the log is collected in a
// second file. Each has a line of its own. Nothing is kept in memory. The trace appears under its
// name when it is complete, and not at all if it does not become so.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

#include "workloads/base/system/temporary.h"
#include "workloads/base/text/json.h"

namespace pirt {

class TraceFile {
 public:
  // How its lines look to a reader that takes one after the other: the first, that on which the log
  // begins (kPart, the header without its last brace, kLog), and the last.
  static constexpr std::string_view kFirstLine = R"({"displayTimeUnit": "ms", "traceEvents": [)";
  static constexpr std::string_view kPart = R"("pirt": )";
  static constexpr std::string_view kLog = R"(,"log": [)";
  static constexpr std::string_view kEnd = "]}}";

  /// @throws Error{kBadInput} if nothing can be written there.
  explicit TraceFile(const std::filesystem::path& path);

  // A write that fails shows in finish().

  /// @param json  One event, or one log entry, as JSON.
  void event(std::string_view json);
  void log(std::string_view json);
  /// @param header  What stands beside "log" under "pirt": an object.
  /// @throws Error{kBadInput} if something could not be written; the trace is then not there, and a
  /// file that was under its name before is as it was.
  void finish(const Json& header);

 private:
  TemporaryFile events_, log_;
  std::int64_t events_count_ = 0, log_count_ = 0;
};

}  // namespace pirt
