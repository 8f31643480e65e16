// Runs of a mix: one in full, or several modes side by side (the paper's Table V for another
// machine or mix).
#pragma once

#include <cstdint>
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

/// Whether the platforms are the same, with what was set of them and left out.
[[nodiscard]] bool on_same_machine(const RunRecord& a, const RunRecord& b);
/// Whether they ran the same, by whatever time: machine, mix, profile, draw, duration, seed.
[[nodiscard]] bool ran_the_same(const RunRecord& a, const RunRecord& b);

/// Tasks that were dropped or expired, but for those of the first firings, which have no
/// predecessor.
[[nodiscard]] std::int64_t dropped_tasks(const RunRecord& run);

/// The mode, with the time where that is not the same of all.
[[nodiscard]] std::string column_name(const RunRecord& run, std::span<const RunRecord> runs);

/// One column a run, one row a figure. Runs of different platforms or mixes are marked as not
/// comparable.
[[nodiscard]] Table modes_table(std::span<const RunRecord> runs);

/// A figure of the run with its mark, and its interval where that spans more than 2 % of it: "~4.67
/// (4.1 to 5.3)".
/// @param name  scheduler/record/interval.h.
[[nodiscard]] std::string shown_figure_of(const RunRecord& run, const std::string& name,
                                          const std::optional<double>& value, Origin origin);

/// "9 of 62 figures are uncertain (contended): other programs took up to 31 % of the time of cpu;
/// ..."; empty where none is.
[[nodiscard]] std::string doubts_text(const RunRecord& run);

/// What it ran, as flags of pirt schedule in any folder: " --profile /home/me/p.db --platform host
/// --mix /home/me/mine.yaml --duration 10s".
[[nodiscard]] std::string scenario_flags(const RunRecord& run);
/// How it was asked for besides, but for mode, weights and seed: " --in-flight 3 --draw p95".
[[nodiscard]] std::string flags_of(const RunRecord& run);
/// What compares modes as these were, of which @p run is one.
/// @param modes  With commas; empty = all.
[[nodiscard]] std::string compare_command(const RunRecord& run, const std::string& modes = "");

}  // namespace pirt
