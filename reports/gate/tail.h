// Calls that take several times as long as they should, a few in a hundred: no median shows them.
#pragma once

#include "reports/gate/table_gate.h"

namespace pirt {

/// A row `call tail`: the shares of samples above thresholds.tail_multiple times the base's median,
/// of the candidate's above that times @p machine. Slower if the share rose by
/// thresholds.tail_share, not by chance (Fisher's exact test), and in half of the candidate's
/// processes or more, since what befalls one of them is no program's; such a rise beside other
/// programs (a note `contended`), in fewer processes, or not beyond @p machine is undecided, and so
/// is one that the samples do not exclude, and all that is doubted or of fewer than
/// kFewestProcesses (validity.h). Not judged: fewer than thresholds.tail_samples a side, and calls
/// so short that their samples are means over batches, where a long call is lost.
/// @param pair     Of phase `call`, with samples read; both have a median above 0.
/// @param doubt    Why nothing may be said of it for sure; empty if it may.
/// @param machine  What the machine made its calls longer by, or may have: a factor, at least 1.
[[nodiscard]] GateRow compare_tails(const PhasePair& pair, const std::string& doubt, double machine,
                                    const GateThresholds& thresholds);

}  // namespace pirt
