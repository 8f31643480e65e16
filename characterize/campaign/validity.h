// What is held against a measured row, and what is noted of it. The vocabulary is documented in
// schema.sql.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "characterize/profile/judgement.h"
#include "characterize/statistics/statistics.h"
#include "characterize/worker/measure.h"

namespace pirt {

/// Samples that a row of a per-call phase needs.
inline constexpr std::int64_t kFewestSamples = 20;
/// Processes that they must come from: below, nothing is known of what lies between processes.
inline constexpr std::int64_t kFewestProcesses = 3;

/// Samples of one phase from all processes of a cell.
struct CellSamples {
  Phase phase = Phase::kCall;
  std::vector<Nanos> samples = {};
  std::vector<std::int32_t> processes = {};  ///< Which process took each, from 0 in order of time.
  std::vector<Nanos> cpu = {};  ///< Processor time of each one's call; empty = not known.
  std::vector<std::optional<double>> others = {};  ///< By process: Interference::others.
  std::int64_t batch = 1;  ///< Calls between two readings of the clock: the fewest of any process.
  std::int64_t odd_stamps = 0;  ///< PhaseSamples::odd_stamps, of all processes.

  /// Whether so many stamps of the device cannot be that the others may be wrong as well.
  [[nodiscard]] bool has_many_odd_stamps() const {
    constexpr std::int64_t kOneIn = 100;
    return kOneIn * odd_stamps > static_cast<std::int64_t>(samples.size());
  }
};

/// What else is known of how a cell's samples were taken.
struct CellConditions {
  ClockQuality clock;  ///< The worst of the processes'.
  bool wrong_output = false;
  bool contended = false;
  bool throttled = false;
  bool unstable = false;
  bool deterministic = false;  ///< The figure repeats exactly: one sample is enough.
  bool live = false;           ///< Calls of a live run: one process took them all.
  bool crowded = false;  ///< `contended`, and others took so much that it may be in all of it.
  bool precise = true;   ///< The cell's `call` and `execute` reached the wished precision.
  std::optional<Nanos> call = {};    ///< Median of the whole call that a phase is part of.
  std::optional<double> taken = {};  ///< PhaseRow::taken, where contended.
};

/// Whether what others took of the cores spoils the cell: it is not precise either, or they took so
/// much that each process may have waited for as long, which no interval shows.
[[nodiscard]] bool is_spoilt_by_others(const CellConditions& conditions);

/// Whether the figure depends on when it was taken: the 95 % intervals of the medians of the first
/// and the second half do not meet, and the medians differ by more than 20 % of the smaller. Below
/// 12 samples nothing can be said: false.
///
/// The limit is a choice: a smaller drift shows in the interval and leaves the order of units as it
/// is, as a rule; the paper's own units differ by factors.
[[nodiscard]] bool is_unstable(std::span<const Nanos> samples);

/// The same over processes in order of time: more than half of them are unstable in themselves, or
/// the medians of the first half of them all lie on one side of those of the second half, and the
/// halves' medians are more than 20 % apart. Below 4 processes only the former can be said.
[[nodiscard]] bool is_unstable(std::span<const Nanos> samples,
                               std::span<const std::int32_t> processes);

/// Whether something that befell @p affected of @p processes concerns the row: a quarter of them or
/// more. The median over processes lies within the quartiles of the others as long as it is fewer.
[[nodiscard]] bool concerns_row(std::int64_t affected, std::int64_t processes);

/// Whether a figure is within a factor that leaves the order of units as it is (see is_unstable):
/// an interval of more than 20 % of the median either way is not. What moves a call of @p call by 5
/// % at most decides nothing and is not judged; it is noted as `precision_not_reached`.
[[nodiscard]] bool is_imprecise(const std::optional<Interval>& interval, Nanos median,
                                const std::optional<Nanos>& call);

/// Of one per-call row. `launch` is stamped by the device and cannot be clock-bound.
[[nodiscard]] Judgement judge(const CellSamples& samples, const CellConditions& conditions);

/// Of the set-ups of one phase and state, one a process in order of time: throttled,
/// unstable, imprecise, contended. Of two, the interval is what they span; differences of less than
/// 1 ms, which a page fault makes, are not judged.
[[nodiscard]] Judgement judge_setups(std::span<const Nanos> times,
                                     const CellConditions& conditions);

/// deterministic, or precision_not_reached, contended, bimodal, live, where they apply.
/// @param precision  Half the 95 % interval over processes, relative to the median.
[[nodiscard]] std::vector<std::string> annotate(const CellSamples& samples,
                                                const CellConditions& conditions, double precision);

}  // namespace pirt
