// Runs of a mix: one in full, or several modes side by side (the paper's Table V for another
// machine or mix).
#pragma once

#include <optional>
#include <span>
#include <string>

#include "reports/document/document.h"
#include "scheduler/record/run_record.h"
#include "workloads/model/phase.h"

namespace pirt {

/// Marks of a run's figures; counts need none.
struct RunMarks {
  Origin time;
  Origin energy;
};
[[nodiscard]] RunMarks marks_of(const RunRecord& run);

/// Of the times of one of its units: what was computed live is measured, the rest comes from
/// virtual time's servers.
[[nodiscard]] Origin time_of(const RunRecord& run, const UnitResult& unit);

/// A figure with its mark, "-" if absent.
[[nodiscard]] std::string shown(const std::optional<double>& value, Origin provenance);
/// In percent and signed: reached / bound - 1; "-" without both.
[[nodiscard]] std::string gap_text(std::optional<double> reached, std::optional<double> bound);

/// What one run did: totals, units, pipelines, weights, and what its figures rest on.
[[nodiscard]] Document run_document(const RunRecord& run);

/// One column a run, one row a figure. Runs of different platforms or mixes are marked as not
/// comparable.
[[nodiscard]] Table modes_table(std::span<const RunRecord> runs);

}  // namespace pirt
