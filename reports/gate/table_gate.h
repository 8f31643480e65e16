// Did anything become slower between two stored profiles? One verdict a row.
//
// The rule is about intervals. Each row has the 95 % interval of its median over processes. A row
// is *slower* if its median rose by at least `effect` and the two intervals are at least half of
// that apart; it is *the same* if the 95 % interval of its change ends below half of that; all else
// is *undecided*, which is named and counted. Before that, what the machine itself moved by is
// taken off: the change of the unit's own peaks between the runs that the row is of (their medians
// where it is of several), which no program changes. A row must be slower beyond it, and to be the
// same it must be so with and without it. It is printed.
//
// What nearly all rows of a unit moved by together, beyond the peaks, is the machine's or the
// program's, and no stored figure says whose: one row says so, which is inconclusive, and the rows
// that moved no further are undecided. Two programs side by side tell (`--baseline-program`).
//
// An interval is over the processes of one run, a few seconds of it, and knows nothing of how the
// machine differs from run to run. How far the other rows of the unit moved from each other does:
// what moved less than eight standard deviations of that is undecided.
//
// A median is blind to a few calls that take long: cells of enough samples have a row `call tail`
// as well, the share of calls above a multiple of the base's median as the machine moved it.
//
// A row that repeats exactly on both sides (counts of an emulator) is slower or faster if it is not
// the same to the nanosecond. What failed in the candidate fails: a wrong output, an error in two
// processes or more, a cell that its own plan has and it has not, though the run ended.
//
// Rows are comparable by what their own runs share, not by what all runs of the two files do.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/profile/store/reader.h"
#include "reports/profile/profile_diff.h"

namespace pirt {

enum class GateVerdict : std::uint8_t {
  kSame,
  kFaster,
  kSlower,
  kFailed,        ///< The candidate crashed, hung, lost a cell or computed something else.
  kInconclusive,  ///< Something is there, and it cannot be told whose.
  /// Nothing was found, though what counts may be there: named, counted, and refused by --strict.
  kUndecided,
  /// Another identity, another workload size, an invalid row, missing, or not reached by its run.
  kNotComparable,
  kNotJudged,  ///< It has nothing to judge by; without influence.
};
[[nodiscard]] std::string_view to_string(GateVerdict verdict);
/// A logarithm of candidate over base, in percent.
[[nodiscard]] double percent_of(double log_ratio);

struct GateThresholds {
  double effect = 0.10;  ///< Rise of a median that counts as slower.
  double setup = 2;      ///< Of set-ups, which a process has one of, so many times that;
  Nanos setup_grain = std::chrono::milliseconds(1);  ///< and at least this.
  double of_call = 0.5;  ///< A phase counts if it makes its call longer by this part of `effect`.
  std::size_t workloads = 6;        ///< Of so many a unit's rows tell what they moved by together,
  double scatter = 8;               ///< and how far apart; so many times that is nothing.
  double together = 0.05;           ///< From here on that is said; of set-ups twice as much.
  std::int64_t tail_samples = 200;  ///< A side.
  double tail_multiple = 3;         ///< Of the base's median.
  double tail_share = 0.02;         ///< Rise of the share of such calls that counts as slower,
  double tail_p = 0.01;             ///< if by chance it is rarer than this.
};

struct GateRow {
  std::string workload = {}, unit = {};
  std::string phase = {};  ///< "execute", "prepare cold", "call tail", "energy".
  bool setup = false;      ///< Of a phase of set-up.
  GateVerdict verdict = GateVerdict::kSame;
  std::string reason = {};  ///< Why it is not same, faster or slower; else empty.
  /// What base and candidate are in: "ns", "J", "share", or the unit that a program says.
  std::string measure = "ns";
  std::optional<double> base = {}, candidate = {};  ///< Medians; shares of a tail.
  std::optional<double> ratio = {};                 ///< Candidate over base.
  std::optional<double> p = {};  ///< Of two programs and of tails: that it is so by chance.
  /// Relative change, and the ends of its interval: least by the gap between both intervals, most
  /// by both widths together. The machine's part is in it.
  std::optional<double> change = {}, at_least = {}, at_most = {};
  std::optional<double> needed = {};  ///< The change that counts as slower.
  bool against_anchor = false;        ///< `base` is the anchor's figure.
  bool is_new = false;                ///< Of a cell that only the candidate has.
};

/// What a unit's own peak changed by: no program does that. One for each change that some row's
/// runs have.
struct MachineShift {
  std::string unit;
  PeakKind kind = PeakKind::kF32;
  double ratio = 1;  ///< Candidate over base: below 1, the machine was slower.
  friend bool operator==(const MachineShift&, const MachineShift&) = default;
};

struct GateResult {
  std::vector<FactDifference> identity;
  std::vector<FactDifference> anchor_identity = {};  ///< Of anchor and candidate.
  std::vector<MachineShift> machine;
  std::vector<MachineShift> anchor_machine = {};  ///< Of anchor and candidate.
  std::vector<GateRow> rows;
  /// Units with a slower row of one run on a side, of too few workloads to tell how runs differ.
  std::set<std::string> unsure = {};
  [[nodiscard]] std::int64_t count(GateVerdict verdict) const;
};

/// @param diff  Its profiles' samples have been read (ProfileReader::read_samples); without them no
///              cell has a tail.
[[nodiscard]] GateResult judge(const ProfileDiff& diff, const GateThresholds& thresholds = {});

/// The rows of @p against, which was judged against an older base, behind those of @p result, and
/// what was taken off there; without the cells that neither the base nor the candidate of @p result
/// has, and those that the older base has not: they are the base's affair.
void add_anchor(GateResult against, GateResult& result);

}  // namespace pirt
