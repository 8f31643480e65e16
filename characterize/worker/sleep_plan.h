#pragma once

#include "workloads/base/time.h"

namespace pirt {

/// How often to measure what follows so long a sleep.
struct SleepPlan {
  Nanos sleep{0};
  int samples = 0;
};

}  // namespace pirt
