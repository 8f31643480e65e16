// Feeds the inputs of a trace into a fresh dispatcher: the same inputs have to give the same
// decisions. What differs would be hidden time, hidden state or a race; or somebody else's trace.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "scheduler/trace/log_json.h"

namespace pirt {

struct ReplayDifference {
  std::size_t entry = 0;  ///< Position in the log.
  Nanos at{0};
  std::string input, recorded, replayed;  ///< "submit task 7", "starts task 7 on gpu", "nothing".
};

struct ReplayResult {
  std::int64_t inputs = 0;     ///< That were replayed.
  std::int64_t decisions = 0;  ///< Starts and ends that were compared and are the same.
  std::optional<ReplayDifference> difference;  ///< The first; the replay stops there.
};

struct FileReplay {
  const PolicyInfo* mode = nullptr;
  std::optional<std::size_t> size;  ///< Of the log; absent if that was not read to its end.
  ReplayResult result;
  bool complete = true;  ///< False: the run did not come to its end, and the log not to that.
};
/// In memory that does not follow the file's length, unless that is laid out otherwise than pirt
/// does. An input that was taken and now is refused, e.g. the completion of a task that does not
/// run, is a difference.
/// @throws Error{kBadInput} naming the file: not there, not a trace of pirt's, another version, a
/// part is missing or does not make sense, the log names what its tables do not have.
[[nodiscard]] FileReplay replay_file(const std::filesystem::path& path);

}  // namespace pirt
