// Which mode to take, and why: what a report of several modes begins with.
//
// Modes are ranked on the same thing: of those that keep up (scheduler/record/keeping_up.h) the
// least energy, if it is known of all of them, else the least tail from firing to completion; if
// none keeps up, the fewest late and dropped real-time firings. Modes that the uncertainty of the
// profile does not let tell apart are named together.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "reports/document/document.h"
#include "scheduler/schedule.h"

namespace pirt {

/// p99 from firing to completion: with deadlines as the largest part of one, of real-time
/// pipelines; without, as times the least that a mode of @p runs has of the same pipeline, the
/// largest. Absent where nothing completed.
[[nodiscard]] std::optional<double> tail_of(const RunRecord& run, std::span<const RunRecord> runs);
/// Whether the tails of two runs cannot be told apart (scheduler/record/interval.h).
[[nodiscard]] bool same_tail(const RunRecord& a, const RunRecord& b);
/// "p99 / deadline", or "p99 from firing to completion".
[[nodiscard]] std::string tail_name(std::span<const RunRecord> runs);

/// The mode whose figure (scheduler/record/interval.h) is the least, or the greatest, of @p among,
/// and then those that cannot be told apart from it; empty if nobody has it.
[[nodiscard]] std::vector<const RunRecord*> best_by(std::span<const RunRecord* const> among,
                                                    const std::string& figure,
                                                    bool greatest = false);
/// By tail_of().
[[nodiscard]] std::vector<const RunRecord*> best_by_tail(std::span<const RunRecord* const> among,
                                                         std::span<const RunRecord> runs);

/// Whether their figures may be ranked: they ran the same, by the same time.
[[nodiscard]] bool comparable(const RunRecord& a, const RunRecord& b);

struct ModeAnswer {
  std::vector<std::string> modes = {};  ///< To take; empty: none ran, or they are not comparable.
  std::string sentence = {};
  std::string doubts = {};  ///< What of it is uncertain, and what to do; empty: nothing is.
  [[nodiscard]] std::vector<std::string> lines() const;
};
[[nodiscard]] ModeAnswer answer_of(const ModeRuns& modes);

/// Its tables: a row a figure and a pipeline, a column a mode, at most six columns each. ✗ marks
/// what does not keep up.
[[nodiscard]] std::vector<Table> answer_tables(std::span<const RunRecord> runs);

}  // namespace pirt
