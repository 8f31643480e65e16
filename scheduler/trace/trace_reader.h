// The log of a trace, entry by entry: what it takes in memory does not follow its length, unless a
// formatter has laid the file out anew.
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "scheduler/trace/log_json.h"
#include "workloads/base/text/json.h"

namespace pirt {

class TraceReader {
 public:
  /// @throws Error{kBadInput} naming the file: not there, not a trace of pirt's, another version.
  explicit TraceReader(const std::filesystem::path& path);

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
  void begin(const std::filesystem::path& path);
  [[nodiscard]] std::optional<LogEntry> next_line();
  [[nodiscard]] std::optional<LogEntry> last(std::size_t size);

  std::string source_;
  std::ifstream in_;
  std::string line_;
  DispatcherSetup setup_;
  std::optional<std::size_t> size_;
  std::size_t read_ = 0;
  std::optional<Json> log_;  ///< Of a file that is laid out otherwise.
  bool torn_ = false;
};

}  // namespace pirt
