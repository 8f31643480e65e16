// The file of a trace: Chrome's JSON, which Perfetto opens, with pirt's own part. Each event and
// each log entry has a line of its own, and nothing is kept in memory.
//
// As a whole (virtual time, which can be had again), the log is a list behind the events, collected
// in a second file; the trace appears under its name when it is complete, and not at all if it does
// not become so:
//
//   {"displayTimeUnit": "ms", "traceEvents": [EVENT, ...], "pirt": {HEADER, "log": [ENTRY, ...]}}
//
// As lines (live, where what a crash leaves is what somebody wants to see), log entries are
// metadata among the events, and the file is under its name from the first of them on:
//
//   [HEADER, EVENT, ENTRY, EVENT, ..., END]
//
// Chrome's format lets the rest of such a list be missing.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

#include "workloads/base/system/temporary.h"
#include "workloads/base/text/json.h"

namespace pirt {

class TraceFile {
 public:
  enum class Layout : std::uint8_t { kWhole, kLines };

  // How the lines of a whole one look to a reader that takes one after the other: the first, that
  // on which the log begins (kPart, the header without its last brace, kLog), and the last.
  static constexpr std::string_view kFirstLine = R"({"displayTimeUnit": "ms", "traceEvents": [)";
  static constexpr std::string_view kPart = R"("pirt": )";
  static constexpr std::string_view kLog = R"(,"log": [)";
  static constexpr std::string_view kEnd = "]}}";

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
  TraceFile(const std::filesystem::path& path, Layout layout, Json header);

  // A write that fails shows in flush() and finish(), and nothing is written after it.

  /// @param json  One event, or one log entry, as JSON.
  void event(std::string_view json);
  /// @throws Error{kBadInput} if the file cannot be given its name.
  void log(std::string_view json);
  /// What was written survives the process, if it is one of lines.
  /// @throws Error{kBadInput} if something could not be written.
  void flush();
  /// @throws Error{kBadInput} if something could not be written; a whole trace is then not there,
  /// and a file that was under its name before is as it was.
  void finish();

 private:
  void line(std::string_view begin, std::string_view json, std::string_view end);

  TemporaryFile events_;
  std::optional<TemporaryFile> log_;  ///< Of a whole one.
  Json header_;
  std::int64_t events_count_ = 0, log_count_ = 0;
};

}  // namespace pirt
