// A live run beside the same run in virtual time: how far off the prediction is for each pipeline
// and unit, what virtual time leaves out, and which rows of the profile the live run contradicts.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "characterize/campaign/validity.h"
#include "characterize/profile/profile.h"
#include "reports/document/document.h"
#include "scheduler/record/run_record.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// A live run, and those of the others in virtual time that predict it: of the same mode, basic
/// mode, platform, mix, duration and frames in flight.
struct LiveRun {
  const RunRecord* live = nullptr;
  std::vector<const RunRecord*> predictions;  ///< In the order given; empty = none was given.
};

/// Each live run of @p runs, which must outlive the result.
[[nodiscard]] std::vector<LiveRun> live_runs(std::span<const RunRecord> runs);

/// What a live run says of a row of the profile.
enum class RowFinding : std::uint8_t {
  kAgrees,
  kContradicted,  ///< Its median is farther than kSameMedian from the interval of the row's.
  kTooFewCalls,   ///< Fewer than kFewestCalls.
  kOwnClock,      ///< The unit tells time by a clock of its own, the live run by the machine's.
  kNoRow,         ///< No valid row: nothing to contradict.
};
/// "agrees", "contradicted", "too few calls", "own clock", "no valid row".
[[nodiscard]] std::string_view to_string(RowFinding finding);

/// A median of fewer says nothing of a row: as many as the row needs itself.
inline constexpr std::int64_t kFewestCalls = kFewestSamples;
/// Relative: as far as a pipeline's predicted median may be off, which such medians add up to.
inline constexpr double kSameMedian = 0.10;

struct RowCheck {
  CallResult live;
  // Of the row: median, and the 95 % interval of it; absent if there is no valid one.
  std::optional<double> median_ms = std::nullopt, low_ms = std::nullopt, high_ms = std::nullopt;
  RowFinding finding = RowFinding::kNoRow;
};

/// Of each workload that the run computed on a unit; paced units make no calls.
/// @param profile  Null = none of the run's platform.
[[nodiscard]] std::vector<RowCheck> check_rows(const RunRecord& live, const Profile* profile);

/// Errors are virtual / live - 1; of utilization, points. Nothing where there is no live run.
/// @param profiles  Null ones are skipped; of each run's platform the first is taken.
[[nodiscard]] std::vector<Part> live_parts(std::span<const RunRecord> runs,
                                           std::span<const Profile* const> profiles);

/// The same: an entry a live run. What is not known is absent.
[[nodiscard]] Json live_json(std::span<const RunRecord> runs,
                             std::span<const Profile* const> profiles);

}  // namespace pirt
