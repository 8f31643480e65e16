#include "scheduler/record/keeping_up.h"

#include <algorithm>

namespace pirt {
namespace {

bool is_real_time(const PipelineResult& pipeline) { return pipeline.real_time.value_or(true); }

}  // namespace

Shortfall shortfall_of(const PipelineResult& pipeline) {
  Shortfall found{
      .late = 0, .dropped = pipeline.dropped - pipeline.no_predecessor.value_or(0), .queued = 0};
  if (!is_real_time(pipeline)) return found;
  // What is unfinished after its deadline is late, and counts once.
  if (pipeline.deadline_ms) {
    found.late = pipeline.deadline_misses.value_or(0);
  } else {
    found.queued = pipeline.queued.value_or(0);
  }
  return found;
}

bool keeps_up(const RunRecord& run) {
  return run.stalled == 0 && std::ranges::all_of(run.pipelines, [](const PipelineResult& pipeline) {
           return shortfall_of(pipeline).firings() == 0;
         });
}

bool misses_rate(const RunRecord& run) {
  constexpr double kRounding = 1e-6;
  return run.min_rate_per_ms &&
         run.throughput_per_ms.value_or(0) < *run.min_rate_per_ms * (1 - kRounding);
}

std::int64_t deadline_misses(const RunRecord& run) {
  std::int64_t misses = 0;
  for (const PipelineResult& pipeline : run.pipelines) {
    misses += pipeline.deadline_misses.value_or(0);
  }
  return misses;
}

std::int64_t real_time_losses(const RunRecord& run) {
  std::int64_t losses = 0;
  for (const PipelineResult& pipeline : run.pipelines) {
    if (!is_real_time(pipeline)) continue;
    const Shortfall shortfall = shortfall_of(pipeline);
    losses += shortfall.late + shortfall.dropped;
  }
  return losses;
}

std::int64_t real_time_queued(const RunRecord& run) {
  std::int64_t queued = 0;
  for (const PipelineResult& pipeline : run.pipelines) queued += shortfall_of(pipeline).queued;
  return queued;
}

std::optional<double> p99_of_deadline(const RunRecord& run) {
  std::optional<double> worst;
  for (const PipelineResult& pipeline : run.pipelines) {
    if (!is_real_time(pipeline) || !pipeline.deadline_ms || !pipeline.p99_ms) continue;
    worst = std::max(worst.value_or(0), *pipeline.p99_ms / *pipeline.deadline_ms);
  }
  return worst;
}

}  // namespace pirt
