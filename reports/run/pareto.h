// All modes on one mix as points: rate, energy, latency; which of them nobody beats, and how far
// they are from what no scheduler can exceed.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "reports/document/chart.h"
#include "reports/document/document.h"
#include "scheduler/frontier.h"
#include "scheduler/record/run_record.h"
#include "workloads/base/text/json.h"

namespace pirt {

struct ModePoint {
  const RunRecord* run = nullptr;  ///< Outlives it.
  double rate_per_ms = 0;          ///< Completed tasks; more is better.
  double energy_mj = 0;            ///< A completed task; less is better.
  double tail = 0;                 ///< tail_of() it (answer.h); less is better.
  /// A mode that is as good in all three and better in one, as far as the two can be told apart
  /// (scheduler/record/interval.h); null = on the front.
  const RunRecord* beaten_by = nullptr;
};

/// Joules a completed task, in mJ; absent where nobody knows them.
[[nodiscard]] std::optional<double> energy_mj(const RunRecord& run);
/// What no schedule of what any of these completed needs less than, in mJ a task.
[[nodiscard]] std::optional<double> least_energy_mj(std::span<const RunRecord> runs);

/// Of runs that compare with the first (answer.h), those that keep up (record/keeping_up.h), or all
/// where none does, in their order.
[[nodiscard]] std::vector<ModePoint> mode_points(std::span<const RunRecord> runs);

/// Rate over energy, with both bounds; latency over energy, with that of energy. Each with the
/// front of its two figures as a line.
[[nodiscard]] std::vector<Chart> pareto_charts(const std::vector<ModePoint>& points);

/// What can be had at best, beside other modes, with the bounds on it, and why other runs are no
/// points.
[[nodiscard]] Document pareto_document(const ModeRuns& frontier);
[[nodiscard]] Json pareto_json(const ModeRuns& frontier);

/// [{"mode", "rate_per_ms", "energy_mj", "tail", "beaten_by"}]
[[nodiscard]] Json pareto_json(const std::vector<ModePoint>& points);

}  // namespace pirt
