// Running another program with a time limit: input in, output and diagnostics out, nothing left
// behind.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

struct ProcessRequest {
  std::filesystem::path program;
  std::vector<std::string> arguments;  ///< Without the program's own name.
  std::string input;                   ///< All of standard input.
  std::vector<std::pair<std::string, std::string>> environment;  ///< On top of this process' own.
  Nanos limit = std::chrono::seconds(60);
  std::size_t most_output = SIZE_MAX;  ///< Bytes of standard output; what prints more is killed.
  const std::atomic<bool>* stop = nullptr;  ///< Looked at several times a second; may be null.
  /// Given what came on standard output; whether the limit begins anew. May be empty.
  std::function<bool(std::string_view)> on_output = {};
};

struct ProcessResult {
  enum class End : std::uint8_t { kExited, kSignalled, kTimedOut, kTooMuch, kStopped };
  End end = End::kExited;
  int code = 0;                ///< Exit status, or the signal's number.
  std::string output;          ///< Standard output.
  std::string diagnostics;     ///< The end of standard error, at most 16 KiB.
  bool out_of_memory = false;  ///< The kernel killed it for memory.
  Nanos wall{0};               ///< From its start until it was seen to have ended.
  Nanos cpu{0};                ///< Processor time, with that of children that it waited for.
  /// The most that it, or one of those, had resident; no less than what it had as a copy of this
  /// process, which the kernel counts as well: what this process has written, and little else.
  std::int64_t peak_bytes = 0;
  std::int64_t inherited_bytes = 0;  ///< As that copy.
};

/// Runs the program to its end, or kills it and whatever it started (its process group) when the
/// limit is over, it has printed too much or @p stop is set. The child is killed too when this
/// process dies, and a terminal's Ctrl-C does not reach it.
/// @throws Error{kEnvironment} if the program cannot be started.
[[nodiscard]] ProcessResult run_process(const ProcessRequest& request);

/// "timed out after 60 s", "crashed (SIGABRT)", "ended with code 3", "ran out of memory (...)",
/// "printed more than 64 MiB".
/// @param limit  The request's.
[[nodiscard]] std::string how_it_ended(const ProcessResult& process, Nanos limit);

/// @p text with control characters as blanks; of longer ones than @p longest characters the end.
[[nodiscard]] std::string one_line(std::string text, std::size_t longest);

}  // namespace pirt
