// What the tests of whole runs in virtual time share.
#pragma once

#include <algorithm>
#include <optional>
#include <string>

#include "tests/scheduler/support.h"

namespace pirt::test {

inline RunRecord run(const Platform& platform, const Mix& mix, ScheduleOptions options) {
  return run_virtual(platform, nullptr, mix, options);
}

inline ScheduleOptions mode(const std::string& name, double duration_s = 0,
                            std::optional<int> in_flight = {}) {
  ScheduleOptions options;
  options.mode = name;
  if (duration_s > 0) options.duration = from_s(duration_s);
  options.in_flight = in_flight;
  return options;
}

inline const UnitResult& unit(const RunRecord& record, const std::string& name) {
  return *std::ranges::find(record.units, name, &UnitResult::unit);
}

inline void expect_balanced(const RunRecord& record) {
  EXPECT_EQ(record.submitted,
            record.completed + record.dropped + record.expired + record.failed + record.queued);
}

/// So many calls in a closed loop.
inline Mix closed(int frames, const std::string& workload = "fc8") {
  return mix_of("mix: m\npipelines: {p: {closed_loop: {frames: " + std::to_string(frames) +
                "}, tasks: [{workload: " + workload + "}]}}\n");
}

/// One unit `cpu` that serves fc8 in 30 ms, one at a time.
inline const std::string kOneModelled = R"(
platform: one
units: {cpu: {slots: 1, active_w: 2, idle_w: 0.5}}
workloads: {fc8: {cpu: [{on: cpu, ms: 30}]}}
)";

}  // namespace pirt::test
