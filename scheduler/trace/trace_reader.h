// The log of a trace, entry by entry: what it takes in memory does not follow its length.
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "scheduler/trace/log_json.h"

namespace pirt {

/// Of a file as TraceFile lays it out: the log begins on a line of its own, and each entry has one.
class TraceReader {
 public:
  /// @throws Error{kBadInput} naming the file: not there, not a trace of pirt's, another version.
  explicit TraceReader(const std::filesystem::path& path);

  /// Whether somebody has laid the file out anew, as a formatter does; then there is nothing here
  /// to read, and parse_trace_log takes it as a whole.
  [[nodiscard]] bool is_laid_out_otherwise() const { return otherwise_; }
  [[nodiscard]] const DispatcherSetup& setup() const { return setup_; }
  /// How many entries there are, as the file says.
  [[nodiscard]] std::size_t size() const { return size_; }
  /// Absent after the last.
  /// @throws Error{kBadInput} for an entry that makes no sense, or if there are more or fewer than
  /// size().
  [[nodiscard]] std::optional<LogEntry> next();

 private:
  void begin();

  std::string source_;
  std::ifstream in_;
  std::string line_;
  DispatcherSetup setup_;
  std::size_t size_ = 0, read_ = 0;
  bool otherwise_ = false;
};

}  // namespace pirt
