// Runs of a mix: one in full, or several modes side by side (the paper's Table V for another
// machine or mix).
#pragma once

#include <span>

#include "reports/document.h"
#include "scheduler/run_record.h"

namespace pirt {

/// What one run did: totals, units, pipelines, weights, and what its figures rest on.
[[nodiscard]] Document run_document(const RunRecord& run);

/// One column a run, one row a figure. Runs of different platforms or mixes are marked as not
/// comparable.
[[nodiscard]] Table modes_table(std::span<const RunRecord> runs);

}  // namespace pirt
