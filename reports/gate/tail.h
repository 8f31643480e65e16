// Calls that take several times as long as they should, a few in a hundred: no median shows them.
#pragma once

#include "reports/gate/table_gate.h"

namespace pirt {

/// A row `call tail`: the shares of samples above thresholds.tail_multiple times the base's median.
/// Slower if the share rose by thresholds.tail_share, not by chance (Fisher's exact test), and in
/// half of the candidate's processes or more, since what befalls one of them is no program's; such
/// a rise beside other programs (a note `contended`), or in fewer processes, is undecided, and so
/// is one that the samples do not exclude, and all that is doubted or of fewer than
/// kFewestProcesses (validity.h). Not judged: fewer than thresholds.tail_samples a side, and calls
/// so short that their samples are means over batches, where a long call is lost.
/// @param pair   Of phase `call`, with samples read; both have a median above 0.
/// @param doubt  Why nothing may be said of it for sure; empty if it may.
[[nodiscard]] GateRow compare_tails(const PhasePair& pair, const std::string& doubt,
                                    const GateThresholds& thresholds);

}  // namespace pirt
