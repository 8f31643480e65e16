// Whether a run serves its mix: one answer for all that ask.
#pragma once

#include <cstdint>
#include <optional>

#include "scheduler/record/run_record.h"

namespace pirt {

/// Firings of a pipeline that went wrong.
struct Shortfall {
  std::int64_t late = 0;     ///< Of a real-time pipeline.
  std::int64_t dropped = 0;  ///< But for the first ones, which had no predecessor.
  std::int64_t queued = 0;   ///< PipelineResult::queued, of a real-time pipeline.
  [[nodiscard]] std::int64_t firings() const { return late + dropped + queued; }
};
[[nodiscard]] Shortfall shortfall_of(const PipelineResult& pipeline);

/// No pipeline has a shortfall, and no task stalls.
[[nodiscard]] bool keeps_up(const RunRecord& run);
/// Whether it does not reach the rate that it had to.
[[nodiscard]] bool misses_rate(const RunRecord& run);
/// Firings of all pipelines past their deadline.
[[nodiscard]] std::int64_t deadline_misses(const RunRecord& run);
/// Late and dropped firings of its real-time pipelines, and those of them that are queued.
[[nodiscard]] std::int64_t real_time_losses(const RunRecord& run);
[[nodiscard]] std::int64_t real_time_queued(const RunRecord& run);

/// Of real-time pipelines with a deadline, the largest p99 from firing to completion as a part of
/// the deadline; absent if none has one, or none completed.
[[nodiscard]] std::optional<double> p99_of_deadline(const RunRecord& run);

}  // namespace pirt
