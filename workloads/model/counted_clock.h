// The time of a device that is emulated or simulated: what has been counted, and nothing of what
// that takes here (Device::own_clock).
#pragma once

#include "workloads/base/time.h"

namespace pirt {

class CountedClock : public Clock {
 public:
  [[nodiscard]] Nanos now() const override { return now_; }
  void advance(Nanos by) { now_ += by; }

 private:
  Nanos now_{0};
};

}  // namespace pirt
