// Schedules a mix on a platform in virtual time: the whole way from files to a result.
#pragma once

#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "scheduler/mix/mix.h"
#include "scheduler/policies/setup.h"
#include "scheduler/record/run_record.h"

namespace pirt {

struct LiveOptions;

/// @param profile  Null = only what the platform file says.
/// @throws Error{kBadInput} as set_up_mode, and for a trace that cannot be written.
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
