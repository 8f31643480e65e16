// When a measured row counts: the reasons that invalidate it and the notes that do not. The
// vocabulary is documented in schema.sql.
#pragma once

#include <string>
#include <vector>

#include "characterize/job.h"
#include "characterize/measure.h"

namespace pirt {

/// Whether the figure depends on when it was taken: the 95 % intervals of the medians of the first
/// and the second half do not meet, and the medians differ by more than 20 % of the smaller. Below
/// 12 samples nothing can be said: false.
///
/// The limit is a choice: a smaller drift shows in the interval and leaves the order of units as it
/// is, as a rule; the paper's own units differ by factors.
[[nodiscard]] bool is_unstable(std::span<const Nanos> samples);

/// Reasons of one per-call row of a sampling job that was done. `launch` is stamped by the device
/// and cannot be clock-bound.
[[nodiscard]] std::vector<std::string> judge(const PhaseSamples& samples, const JobResult& result,
                                             const SamplingOptions& options, bool unstable);

/// precision_not_reached, contended, bimodal, where they apply.
[[nodiscard]] std::vector<std::string> annotate(const PhaseSamples& samples,
                                                const JobResult& result,
                                                const SamplingOptions& options);

}  // namespace pirt
