// The log of a trace, entry by entry: what it takes in memory does not follow its length.
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "scheduler/trace/log_json.h"

namespace pirt {

/// Of a file as TraceFile lays it out: each entry has a line of its own.
class TraceReader {
 public:
  /// @throws Error{kBadInput} naming the file: not there, not a trace of pirt's, another version.
  explicit TraceReader(const std::filesystem::path& path);

  /// Whether a formatter, or an older pirt, has laid the file out; then there is nothing here to
  /// read, and parse_trace_log takes it as a whole.
  [[nodiscard]] bool is_laid_out_otherwise() const { return otherwise_; }
  [[nodiscard]] const DispatcherSetup& setup() const { return setup_; }
  /// How many entries there are, as the file says at its end.
  [[nodiscard]] std::optional<std::size_t> size() const { return size_; }
  /// Whether the end is missing; known after the last entry.
  [[nodiscard]] bool ends_in_the_middle() const { return torn_; }
  /// Absent after the last.
  /// @throws Error{kBadInput} for an entry that makes no sense, or if there are more or fewer than
  /// size().
  [[nodiscard]] std::optional<LogEntry> next();

 private:
  void begin();
  [[nodiscard]] std::optional<LogEntry> next_line();
  [[nodiscard]] std::optional<LogEntry> last(std::size_t size);

  std::string source_;
  std::ifstream in_;
  std::string line_;
  DispatcherSetup setup_;
  std::optional<std::size_t> size_;
  std::size_t read_ = 0;
  bool otherwise_ = false, torn_ = false;
};

}  // namespace pirt
