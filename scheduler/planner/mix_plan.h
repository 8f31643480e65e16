// A plan for a whole mix, made before it runs: which unit serves each task, and in what order.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "scheduler/mix/task.h"
#include "scheduler/planner/planner.h"
#include "scheduler/services/scenario.h"

namespace pirt {

struct MixPlan {
  struct Entry {
    UnitId unit = 0;
    Nanos start{0};
    Nanos finish{0};
    /// The entry whose turn on the unit is before; absent = it is the first.
    std::optional<std::uint32_t> previous;
  };
  std::vector<Entry> entries;  ///< All tasks of all pipelines; the position is TaskClass::entry.
  Nanos makespan{0};           ///< If all find an image buffer.
};

/// Pure: the same mix, platform and services give the same plan. If every pipeline fires once, and
/// finds an image buffer, the order on a unit is of all tasks; otherwise of those of one pipeline,
/// as pipelines fire at rates of their own.
[[nodiscard]] MixPlan plan_mix(const Scenario& scenario, Planner planner);

}  // namespace pirt
