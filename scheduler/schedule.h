// Schedules a mix on a platform in virtual time: the whole way from files to a result.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "scheduler/mix/mix.h"
#include "scheduler/policies/setup.h"
#include "scheduler/record/run_record.h"
#include "scheduler/record/tally.h"

namespace pirt {

class Dispatcher;
class TraceWriter;
struct PlannedBudget;

/// @param profile  Null = only what the platform file says.
/// @param planned  What mode budget planned before for the same, or where to keep it; null = it
/// plans.
/// @throws Error{kBadInput} as set_up_mode, and for a trace that cannot be written.
[[nodiscard]] RunRecord run_virtual(const Platform& platform, const Profile* profile,
                                    const Mix& mix, const ScheduleOptions& options,
                                    std::optional<PlannedBudget>* planned = nullptr);

/// The same, and then on kRedraws redrawn profiles (services/redraw.h): the record has the
/// intervals of its figures, where something that it rests on was measured.
[[nodiscard]] RunRecord run_with_intervals(const Platform& platform, const Profile* profile,
                                           const Mix& mix, const ScheduleOptions& options);

/// What spends the time of a run.
/// @param trace  Is to hear of all that happens; null = nobody.
using Driver =
    std::function<Tally(const Scenario& scenario, Dispatcher& dispatcher, TraceWriter* trace)>;
/// Anything but the time that @p driver spends; run_virtual and run_live (schedule_live.h) are
/// this.
/// @param time  "virtual" or "live".
/// @throws As run_virtual, and what the driver throws.
[[nodiscard]] RunRecord run_mix(const Platform& platform, const Profile* profile, const Mix& mix,
                                const ScheduleOptions& options, const Driver& driver,
                                const std::string& time,
                                std::optional<PlannedBudget>* planned = nullptr);

/// "latency", "throughput", "energy", "advanced".
[[nodiscard]] std::vector<std::string> paper_modes();

/// What several modes make of one mix.
struct ModeRuns {
  struct Skipped {
    std::string mode;
    std::string reason;
  };
  std::vector<RunRecord> runs = {};
  std::vector<Skipped> skipped = {};  ///< Modes that cannot run there, and why.
};

/// Each reason once: "latency, energy: no unit can serve sobel".
[[nodiscard]] std::vector<std::string> reason_lines(const std::vector<ModeRuns::Skipped>& skipped);

/// Runs each of the modes, with intervals.
/// @param options  Its overflow is for those modes that have one.
/// @throws Error{kBadInput}: unknown mode, an overflow that none of them has.
[[nodiscard]] ModeRuns run_modes(const Platform& platform, const Profile* profile, const Mix& mix,
                                 const std::vector<std::string>& modes, ScheduleOptions options);

}  // namespace pirt
