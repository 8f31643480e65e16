// Between what a figure of a run lies, where what its calls take is not known exactly.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scheduler/record/run_record.h"

namespace pirt {

/// The figures of a run that are compared and shown with an interval, by name: "throughput_per_ms",
/// "energy_j", "average_power_w", "mean_latency_ms", "p99_latency_ms", "p99_of_deadline",
/// "real_time_losses", "real_time_queued", "pipelines.NAME.p99_ms". Those that are not known are
/// not there.
using RunFigures = std::map<std::string, double>;
[[nodiscard]] RunFigures figures_of(const RunRecord& run);

/// Of each figure, where 95 % of the redrawn ones lie.
/// @param redrawn  figures_of the same run on as many redrawn profiles.
[[nodiscard]] std::map<std::string, FigureInterval> intervals_of(
    std::span<const RunFigures> redrawn);

/// Whether a figure of two runs cannot be told apart: the interval of its paired difference, on the
/// same redrawn profiles, holds 0. Of stored runs, which have none: their intervals overlap, or,
/// where they have none either, the two are the same.
[[nodiscard]] bool cannot_tell(const RunRecord& a, const RunRecord& b, const std::string& figure);

}  // namespace pirt
