// What two runs of one program differ by: the figures of a row that say whether another run's are
// another program's.
#pragma once

#include <optional>
#include <span>

#include "characterize/profile.h"

namespace pirt {

/// Relative spread of one process's median around those of the others: their median absolute
/// deviation as a standard deviation. Robust: a busy spell lifts a few processes far.
/// Absent for fewer than two processes. @param medians  Of each process; above 0.
/// @source Factors for few: Croux and Rousseeuw, Time-efficient algorithms for two highly robust
/// estimators of scale, Computational Statistics 1 (1992) 411.
[[nodiscard]] std::optional<double> process_spread(std::span<const double> medians);

/// The spread of that run whose processes differ more: of few processes with two levels, the other
/// may have met one by chance. Absent where neither has two processes.
[[nodiscard]] std::optional<double> spread_between(const PhaseRow& base, const PhaseRow& candidate);

/// Relative standard deviation of the ratio of the medians of two runs of one program, A/A noise:
/// what the medians of so many processes differ by, and `drift` times the spread of processes for
/// each run. Absent where there is no spread.
[[nodiscard]] std::optional<double> noise_between(const PhaseRow& base, const PhaseRow& candidate,
                                                  double drift);

/// Runs lie apart in time, and what slows a machine for a while moves all processes of a run: clock
/// and memory drift as much from run to run as within one, and more processes do not average it
/// out. Standard deviation of a run's median by this, over the spread of the processes within.
/// Measured in ten runs on a quiet machine: 0.3 for rows that stay in the cache, 0.6 to 1.2 for
/// those that read memory and for those of a few microseconds.
inline constexpr double kDrift = 1.0;

/// What a row changes by while one process runs: the second half of its samples over the first, by
/// their medians, as a logarithm without sign; the median over the processes. Absent if none took
/// eight samples.
[[nodiscard]] std::optional<double> wander_of(const PhaseRow& row);

/// Logarithm of candidate over base, the nearer to `shift` of two: of the medians, and of the lower
/// quartiles of the process medians. A slower program moves both, a busy spell of the machine the
/// upper part only. 0 = as `shift` says. Absent without valid medians above 0.
/// @param shift  What is expected, as a logarithm; it is subtracted.
[[nodiscard]] std::optional<double> change_between(const PhaseRow& base, const PhaseRow& candidate,
                                                   double shift);

}  // namespace pirt
