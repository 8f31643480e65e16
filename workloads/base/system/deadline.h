// How long another process is waited for, where this one may be stopped meanwhile (Ctrl-Z, docker
// pause, a debugger): it cannot tell whether the other one went on.
#pragma once

#include <algorithm>
#include <chrono>

#include "workloads/base/time.h"

namespace pirt {

class Deadline {
 public:
  Deadline(Nanos now, Nanos limit) : end_(now + limit), due_(now) {}

  /// For how long to wait now, at most @p most; 0 = the limit is over, and what is there at this
  /// look is the last. Who comes much later than was said was stopped: that time does not count.
  [[nodiscard]] Nanos next_wait(Nanos now, Nanos most) {
    constexpr Nanos kAway = std::chrono::seconds(2);
    if (now - due_ > kAway) end_ += now - due_;
    const Nanos wait = std::clamp(end_ - now, Nanos(0), most);
    due_ = now + wait;
    return wait;
  }

 private:
  Nanos end_;
  Nanos due_;  ///< When the next look was to be.
};

/// As poll() has it: no shorter.
[[nodiscard]] inline int poll_ms(Nanos wait) {
  return static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(wait).count());
}

}  // namespace pirt
