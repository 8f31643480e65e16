// Two programs compared cell by cell, as a pure function of what was measured: what is known, what
// is decided, and what to measure next.
//
// Everything enters through apply() as an event of the ledger, so that replaying a ledger is the
// same as having measured. Events: {"check": ...} is a verified first process of one side,
// {"block": ...} four timed ones, {"failure": ...} the end of a cell.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "characterize/duet/rule.h"
#include "characterize/duet/sample.h"
#include "workloads/base/text/json.h"

namespace pirt {

enum class Side : std::uint8_t { kBaseline, kCandidate };
[[nodiscard]] std::string_view to_string(Side side);

/// What a cell needs next.
struct DuetStep {
  std::size_t cell = 0;
  enum class Kind : std::uint8_t { kCheck, kBlock, kCanary } kind = Kind::kCheck;
  /// Who runs, in this order; of a check one each.
  std::vector<Side> order;
  SampleKind sample = SampleKind::kTimed;  ///< What each of them does.
};

/// Runs by side that lacked a figure: it was missing, 0 though more of it is better, or the other
/// side's was 0 though less of it is.
using RunsWithout = std::array<std::size_t, 2>;

/// Blocks in which a series had no time, until it is given up: what a program says of a phase at
/// times only (a device that stamps some launches) would be asked for without end.
inline constexpr std::size_t kMostWithout = 8;

/// One phase of a cell.
struct DuetSeries {
  DuetRule rule;
  std::vector<double> base_s, candidate_s;  ///< Of each process, in what `measure` says, or
                                            ///< seconds; canaries are not in it.
  std::size_t without = 0;        ///< Blocks in which it had no time, until it was decided.
  RunsWithout runs_without = {};  ///< Of those blocks.
  Measure measure = {"s"};
};

/// One cell.
struct DuetCellState {
  DuetCell cell;
  std::array<std::optional<Sample>, 2> checks;  ///< By side.
  std::array<std::string, 2> failures;  ///< By side: why it has no more samples; empty = none.
  std::string not_comparable;           ///< Empty = it is.
  std::map<std::string, DuetSeries> series;
  /// Figures, but parts of calls, that some of the first processes of both have above 0, and others
  /// not.
  std::map<std::string, RunsWithout> passing;
  std::size_t blocks = 0, canaries = 0;

  [[nodiscard]] bool ended() const;    ///< Nothing can be measured any more.
  [[nodiscard]] bool decided() const;  ///< Nothing needs to.
  /// Whether only phases of set-up are undecided, so that calls need not be repeated for them.
  [[nodiscard]] bool calls_decided() const;
  [[nodiscard]] std::vector<std::string> undecided() const;  ///< Names of series.
  /// Whether a confirmation has had too few canaries.
  [[nodiscard]] bool wants_canary() const;
};

class DuetComparison {
 public:
  /// @param limit  Of one process: what has timed out under a shorter one is tried again.
  DuetComparison(std::vector<DuetCell> cells, std::uint64_t seed, Nanos limit = {});

  /// Cells in turns, each turn in a random order of its own; ABBA and BAAB as often. While
  /// something of a cell is being confirmed, a canary before every second block: an alarm needs
  /// them, and to be cleared takes none. Nothing if all is decided.
  /// @param among  Indices of the cells in question.
  [[nodiscard]] std::optional<DuetStep> next(std::span<const std::size_t> among) const;

  using Event = Json;
  /// The event of a step whose processes all answered.
  /// @param samples  As long as step.order.
  [[nodiscard]] Event event_of(const DuetStep& step, const std::vector<Sample>& samples) const;
  /// Why a sample cannot stand beside the side's first one: a figure in another unit or direction;
  /// empty = it can.
  [[nodiscard]] std::string unlike_first(const DuetStep& step, Side side,
                                         const Sample& sample) const;
  /// @param timed_out  Whether a longer limit may help.
  [[nodiscard]] Event failure_of(const DuetStep& step, Side side, const std::string& error,
                                 bool timed_out = false) const;
  /// @throws Error{kBadInput} if it is none of the events above, or of no cell of this comparison.
  void apply(const Event& event);

  [[nodiscard]] const std::vector<DuetCellState>& cells() const { return cells_; }
  [[nodiscard]] std::size_t decided() const;
  [[nodiscard]] std::size_t processes() const { return processes_; }

 private:
  DuetCellState& cell_of(const Event& event);
  void check(DuetCellState& state, const Event& event);
  void block(DuetCellState& state, const Event& event);
  void start_series(DuetCellState& state, const std::string& order,
                    const std::vector<std::map<std::string, double>>& seconds);
  [[nodiscard]] std::size_t turn_of(const DuetCellState& state) const;
  /// Of all cells. Cells take turns, so that long before a confirmation all of them have theirs.
  [[nodiscard]] std::size_t series_count() const;

  std::vector<DuetCellState> cells_;
  std::uint64_t seed_;
  Nanos limit_;
  std::size_t processes_ = 0;
};

}  // namespace pirt
