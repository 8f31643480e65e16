// What two runs of one program differ by: the figures of a row that say whether another run's are
// another program's.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "characterize/profile/profile.h"

namespace pirt {

/// Relative spread of one process's median around those of the others: their median absolute
/// deviation as a standard deviation. Robust: a busy spell lifts a few processes far.
/// Absent for fewer than two processes. @param medians  Of each process, or other figures that
/// should be alike; above 0.
/// @source Factors for few: Croux and Rousseeuw, Time-efficient algorithms for two highly robust
/// estimators of scale, Computational Statistics 1 (1992) 411.
[[nodiscard]] std::optional<double> process_spread(std::span<const double> medians);

/// The spread of that run whose processes differ more: of few processes with two levels, the other
/// may have met one by chance. Absent where neither has two processes.
[[nodiscard]] std::optional<double> spread_between(const PhaseRow& base, const PhaseRow& candidate);

/// Runs lie apart in time, and what slows a machine for a while moves all processes of a run: clock
/// and memory drift as much from run to run as within one, and more processes do not average it
/// out. Standard deviation of a run's median by this, over the spread of the processes within.
/// Measured in ten runs on a quiet machine: 0.3 for rows that stay in the cache, 0.6 to 1.2 for
/// those that read memory and for those of a few microseconds.
inline constexpr double kDrift = 1.0;

/// Rows that others on the machine push about have processes that differ widely, but what runs
/// differ by once the common movement of such rows is taken off grows with the root of that only:
/// each run has met many states of the machine. This is the drift of two runs from which on; found
/// by what 66 runs of one machine, in hours of different noise, differ by (tests/bench/README.md).
inline constexpr double kWideDrift = 0.035;

enum class Drift : std::uint8_t {
  kWhole,     ///< kDrift times the spread of the processes, for either run.
  kOfOneRow,  ///< The common movement is taken off: beyond kWideDrift its geometric mean with that.
};

/// Relative standard deviation of the ratio of the medians of two runs of one program, A/A noise:
/// what the medians of so many processes differ by, and the drift of the runs. Absent where there
/// is no spread.
[[nodiscard]] std::optional<double> noise_between(const PhaseRow& base, const PhaseRow& candidate,
                                                  Drift drift);

/// Half the width of the 95 % interval of the ratio of both medians, as a part of it: those over
/// the processes of either run (interval_over_processes), put together. Absent where one has none.
/// @param base  Both have samples.
[[nodiscard]] std::optional<double> half_width_between(const PhaseRow& base,
                                                       const PhaseRow& candidate);

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
