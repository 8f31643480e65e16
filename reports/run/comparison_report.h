// Several modes on one mix, one row a mode: what each reaches, how far that is from what is
// possible, and what it costs.
#pragma once

#include <vector>

#include "reports/document/document.h"
#include "scheduler/mix/mix.h"
#include "scheduler/schedule.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// What is not in a table of these modes, and why.
[[nodiscard]] Paragraph missing_of(const ModeRuns& comparison);
/// What they warn of, each once.
[[nodiscard]] Paragraph warnings_of(const std::vector<RunRecord>& runs);

/// Gaps are relative to each run's bounds; the costs, energy and p99 latency, to the best mode of
/// the table.
///
/// Where mode advanced is among the runs, and its basic scheduler too, the footnotes say what
/// strict priority does to real-time pipelines without images: their p99 latency and missed
/// deadlines under both.
/// @param details  With counts, weights and gaps to the bounds.
[[nodiscard]] Document comparison_document(const ModeRuns& comparison, const Mix& mix,
                                           bool details = true);
[[nodiscard]] Json comparison_json(const ModeRuns& comparison);

}  // namespace pirt
