// The file of a trace: Chrome's JSON, which Perfetto opens, with pirt's own part as metadata among
// the events. Each has a line of its own, and nothing is kept in memory:
//
//   [HEADER, EVENT, ENTRY, EVENT, ..., END]
//
// It appears under its name when it is complete, or once it is flushed: of a live run what a crash
// leaves is what somebody wants to see. Chrome's format lets the rest of such a list be missing.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

#include "workloads/base/system/temporary.h"
#include "workloads/base/text/json.h"

namespace pirt {

class TraceFile {
 public:
  // The names of pirt's own among lines, and with what such a line begins: the first (behind a
  // bracket), each of the log, and the last, which says how many inputs there were.
  static constexpr std::string_view kHeaderName = "pirt";
  static constexpr std::string_view kEntryName = "pirt log";
  static constexpr std::string_view kEndName = "pirt end";
  static constexpr std::string_view kHeaderLine = R"([{"name":"pirt","ph":"M","pid":0,"args":)";
  static constexpr std::string_view kEntryLine = R"({"name":"pirt log","ph":"M","pid":0,"args":)";
  static constexpr std::string_view kEndLine = R"({"name":"pirt end","ph":"M","pid":0,"args":)";

  /// @param header  What stands beside the log: an object.
  /// @throws Error{kBadInput} if nothing can be written there.
  TraceFile(const std::filesystem::path& path, const Json& header);

  // A write that fails shows in flush() and finish(), and nothing is written after it.

  /// @param json  One event, or one log entry, as JSON.
  void event(std::string_view json) { line({}, json, ",\n"); }
  void log(std::string_view json);
  /// What was written survives the process, from the first log entry on.
  /// @throws Error{kBadInput} if something could not be written.
  void flush();
  /// @throws Error{kBadInput} if something could not be written; what was never flushed is then not
  /// there, and a file that was under its name before is as it was.
  void finish();

 private:
  void line(std::string_view begin, std::string_view json, std::string_view end);

  TemporaryFile file_;
  std::int64_t log_count_ = 0;
  bool published_ = false;
};

}  // namespace pirt
