// What a comparison of two programs says, as the rows and the report of the gate.
#pragma once

#include <string>
#include <vector>

#include "characterize/duet/duet.h"
#include "reports/gate/gate_report.h"

namespace pirt {

/// A row a phase of each cell, corrected for how many there are; a cell that failed or cannot be
/// compared has a row for phase "all" as well.
/// @param end    How measuring ended: what is undecided is inconclusive, for that reason.
/// @param alpha  Of the whole table.
[[nodiscard]] GateResult judge_duet(const DuetComparison& comparison, DuetEnd end,
                                    double alpha = 0.05);

/// Workloads whose fastest unit by `call` is another one on the candidate, by at least 5 % before
/// and after ("clear"), or less.
[[nodiscard]] std::vector<Flip> find_flips(const GateResult& result);

/// The rule of two programs, for calls and for set-up, and what of report.result is not judged.
void describe_rule(GateReport& report);

}  // namespace pirt
