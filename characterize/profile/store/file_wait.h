// How long whoever uses a profile database waits for other programs that use it.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string>

#include "workloads/base/time.h"

namespace pirt {

struct FileWait {
  FileWait() = default;
  template <typename Rep, typename Period>
  FileWait(std::chrono::duration<Rep, Period> at_most) : longest(at_most) {}

  /// At most; absent = as long as it takes.
  std::optional<Nanos> longest = std::chrono::seconds(10);
  /// Ends a wait a moment after it is set; may be null.
  const std::atomic<bool>* stop = nullptr;
  /// Told of each wait that is longer than a second, in a line; may be empty.
  std::function<void(const std::string&)> notice = {};
};

}  // namespace pirt
