// Schedules a mix on a platform in virtual time: the whole way from files to a result.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "scheduler/mix/mix.h"
#include "scheduler/record/run_record.h"
#include "scheduler/services/services.h"
#include "workloads/base/time.h"

namespace pirt {

inline constexpr Nanos kDefaultDuration = std::chrono::seconds(60);

struct ScheduleOptions {
  std::string mode;                  ///< A name of the policy table.
  std::string basic = "throughput";  ///< Fallback of mode advanced.
  std::map<std::string, int>
      weights;                    ///< By unit; empty = the platform's for the mode, else derived.
  std::optional<int> in_flight;   ///< Frames in flight of closed loops; absent = the platform's,
                                  ///< else what keeps the units busy.
  bool literal_overflow = false;  ///< Algorithms 2 and 3 as printed, instead of holding.
  bool allow_invalid = false;     ///< Use profile rows that are not valid.
  Draw draw = Draw::kMedian;      ///< What a profile's rows take.
  std::optional<Nanos> duration;  ///< Of open loops; absent = kDefaultDuration.
  std::uint64_t seed = 1;
  std::optional<std::string> trace;  ///< Path; see trace/trace_writer.h.
};

/// @param profile  Null = only what the platform file says.
/// @throws Error{kBadInput}: unknown mode, bad weights, a duration or in_flight below 1, a duration
/// for a mix without open loop,
///         `eligible` that names nothing, a platform of more than 64 units, a profile of another
///         platform, a trace that cannot be written, a workload that no unit (or none that the mode
///         uses) can serve: then with each unit's reason and the command that measures it.
[[nodiscard]] RunRecord run_virtual(const Platform& platform, const Profile* profile,
                                    const Mix& mix, const ScheduleOptions& options);

}  // namespace pirt
