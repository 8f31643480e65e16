// Did anything become slower between two stored profiles? One verdict a row, corrected for how many
// rows are looked at.
//
// What both were measured under comes first: rows of runs that differ in identity are not
// comparable, and say in what. A row is slower if a one-sided Mann-Whitney test on its raw samples
// says so after Holm's correction over the table, and its median and its lower quartile rose by at
// least `effect` and by `noise_factor` times the A/A noise (between_runs.h); a phase of a call that
// is small beside it, such as `launch`, also by so much that a call is `of_call` longer. Nearly as
// much is inconclusive: measure again. A row of which nothing of that holds is the same only if the
// 95 % interval of its change, over the medians of the processes, says that it is not slower by
// what counts; else one cannot tell.
//
// A row that repeats exactly on both sides (counts of an emulator) is slower or faster if it is not
// the same to the nanosecond.
//
// Machines have slow hours: what many rows moved by together (common_movement.h) is taken off each
// of them and judged in a row of its own, which is inconclusive at worst, since no stored figure
// says whether the machine or the program was it. Two programs side by side do
// (`--baseline-program`).
#pragma once

#include <cstdint>
#include <optional>
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
  kFailed,  ///< The candidate crashed, hung or computed something else.
  kInconclusive,
  /// Nothing was found, though what counts may be there: shown, and without influence.
  kCannotTell,
  kNotComparable,  ///< Another identity, another workload size, an invalid row, or missing.
  kNotJudged,      ///< Too few samples for the test; shown, and without influence.
};
[[nodiscard]] std::string_view to_string(GateVerdict verdict);

struct GateThresholds {
  double alpha = 0.05;  ///< Of the whole table, per direction.
  double effect = 0.05;
  double of_call = 0.025;  ///< What a phase adds to a call to count, as a share of the call.
  double noise_factor = 3;
  double doubt = 0.8;         ///< Of what counts as slower: from there on inconclusive.
  std::size_t workloads = 6;  ///< So many tell what all of them moved by.
  double together = 0.10;     ///< What all of them move by without anybody's doing.
  std::size_t samples = 9;    ///< A side.
};

struct GateRow {
  std::string workload = {}, unit = {};
  std::string phase = {};  ///< "execute", "prepare cold", "energy".
  GateVerdict verdict = GateVerdict::kSame;
  std::string reason = {};  ///< Why it is not same, faster or slower; else empty.
  std::optional<double> base = {}, candidate = {};  ///< Medians in ns; joules a call of "energy".
  std::optional<double> ratio = {};                 ///< Candidate over base.
  std::optional<double> p = {};                     ///< Adjusted, of the direction that it went.
  /// Relative change that counts: without what rows moved by together, and that of the median or of
  /// the lower quartile, whichever is less.
  std::optional<double> change = {};
  /// Upper end of the 95 % interval of the change, over the medians of the processes; absent below
  /// 3 processes a side.
  std::optional<double> at_most = {};
  std::optional<double> noise = {};   ///< Relative standard deviation between runs of one program.
  std::optional<double> needed = {};  ///< The change that counts as slower.
};

struct GateResult {
  std::vector<FactDifference> identity;
  std::vector<GateRow> rows;
  [[nodiscard]] std::int64_t count(GateVerdict verdict) const;
};

/// @param diff  Its profiles' samples have been read (ProfileReader::read_samples).
[[nodiscard]] GateResult judge(const ProfileDiff& diff, const GateThresholds& thresholds = {});

}  // namespace pirt
