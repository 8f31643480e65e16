// Schedules a mix on a platform in virtual time: the whole way from files to a result.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "scheduler/mix/mix.h"
#include "scheduler/record/run_record.h"
#include "scheduler/services/faults.h"
#include "scheduler/services/services.h"
#include "workloads/base/time.h"

namespace pirt {

struct LiveOptions;

inline constexpr Nanos kDefaultDuration = std::chrono::seconds(60);

/// What Algorithms 2 and 3 do when all queues are full.
enum class Overflow : std::uint8_t {
  kHold,     ///< The task waits.
  kLiteral,  ///< As printed: the `else`.
};

struct ScheduleOptions {
  std::string mode;                  ///< A name of policies().
  std::string basic = "throughput";  ///< Fallback of mode advanced.
  std::map<std::string, int>
      weights;                   ///< By unit; empty = the platform's for the mode, else derived.
  std::optional<int> in_flight;  ///< Frames in flight of closed loops; absent = the platform's,
                                 ///< else what keeps the units busy.
  std::optional<Overflow> overflow;  ///< Absent = hold.
  bool allow_invalid = false;        ///< Use profile rows that are not valid.
  Draw draw = Draw::kMedian;         ///< What a profile's rows take.
  std::optional<Nanos> duration;     ///< Of open loops; absent = kDefaultDuration.
  std::uint64_t seed = 1;
  std::optional<Faults> faults;      ///< Calls that do not complete; absent = none.
  std::optional<std::string> trace;  ///< Path; see trace/trace_writer.h.
};

/// @param profile  Null = only what the platform file says.
/// @throws Error{kBadInput}: unknown mode, bad weights, a duration or in_flight below 1, a duration
/// for a mix without open loop, an overflow for a mode that has none,
///         `eligible` that names nothing, a platform of more than 64 units, a profile of another
///         platform, a trace that cannot be written, a workload that no unit (or none that the mode
///         uses) can serve: then with each unit's reason and the command that measures it.
[[nodiscard]] RunRecord run_virtual(const Platform& platform, const Profile* profile,
                                    const Mix& mix, const ScheduleOptions& options);

/// The same by the machine's clock, with real kernels on units that have a backend; see
/// runtime/live_run.h.
/// @throws As above, and Error{kEnvironment} for a device that cannot be opened.
[[nodiscard]] RunRecord run_live(const Platform& platform, const Profile* profile, const Mix& mix,
                                 const ScheduleOptions& options, const LiveOptions& live);

/// "latency", "throughput", "energy", "advanced".
[[nodiscard]] std::vector<std::string> paper_modes();

/// What several modes make of one mix.
struct ModeRuns {
  struct Skipped {
    std::string mode;
    std::string reason;
  };
  std::vector<RunRecord> runs;
  std::vector<Skipped> skipped;  ///< Modes that cannot run there, and why.
};

/// Each reason once: "latency, energy: no unit can serve sobel".
[[nodiscard]] std::vector<std::string> reason_lines(const std::vector<ModeRuns::Skipped>& skipped);

/// Runs each of the modes.
/// @param options  Its overflow is for those modes that have one.
/// @throws Error{kBadInput}: unknown mode, an overflow that none of them has.
[[nodiscard]] ModeRuns run_modes(const Platform& platform, const Profile* profile, const Mix& mix,
                                 const std::vector<std::string>& modes, ScheduleOptions options);

}  // namespace pirt
