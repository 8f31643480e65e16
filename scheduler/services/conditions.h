// What a call takes beside its steady rows, by what else happened: figures of a profile, and which
// of them belong to which unit. What virtual time makes of them: virtual/call_effects.h.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "characterize/statistics/distribution.h"

namespace pirt {

enum class Draw : std::uint8_t;

/// Of one workload on one unit.
struct CallConditions {
  /// `execute` with the unit's own caches full of other bytes, and with all that it reaches;
  /// absent = as steady, and as with its own ones.
  std::optional<Distribution> cold_cache, cold_memory;
  double beside_memory = 1;   ///< `execute` beside a unit that streams, over steady.
  double beside_compute = 1;  ///< The same beside one that computes.
  Nanos usual_worst{0};       ///< p95 of the slowest of these, the slowdowns apart.
  std::int64_t bytes = 0;     ///< A call touches: Workload::bytes().
  bool streams = false;       ///< Memory, not arithmetic, is what its calls wait for.

  /// How many times as long a call takes at most beside one that runs all the time.
  [[nodiscard]] double slowest_beside() const {
    return std::max({1.0, beside_memory, beside_compute});
  }
};

/// Of a unit.
struct UnitConditions {
  struct Handover {
    Nanos sleep{0};
    Distribution time;
  };
  /// Which part of what its caches held they have lost after a while, other calls apart.
  struct Forgotten {
    Nanos after{0};
    double part = 0;
  };
  std::vector<Handover> handovers;    ///< By sleep; empty = it takes no time.
  Nanos longest_handover{0};          ///< p95, after the sleep where that is the longest.
  std::optional<Distribution> leave;  ///< UnitPhase::kLeave; absent = two hand-overs behind a call.
  Nanos longest_leave{0};             ///< p95; absent = of the second of these.
  std::vector<Forgotten> forgotten;   ///< By time; empty = nothing.
  std::int64_t cache_bytes = 0;       ///< Its own; 0 = not known.
  std::int64_t last_cache_bytes = 0;  ///< The last that it reaches; 0 = not known.
};

/// Of a row with samples, what 95 of 100 calls do not exceed; of a doubted one, no less than where
/// its median may be.
template <typename Row>
[[nodiscard]] Nanos usual_worst_of(const Row& row);

/// A row as --draw says.
/// @param row  Has samples.
template <typename Row>
[[nodiscard]] Distribution time_of(const Row& row, Draw draw);

/// @param strict  As ScheduleOptions::strict.
/// @return  Absent where the profile has no row of another condition, and where `execute` has no
/// valid steady row, or one of a live run, which has all of it in it.
[[nodiscard]] std::optional<CallConditions> call_conditions(const Profile& profile,
                                                            const std::string& workload,
                                                            const std::string& unit,
                                                            std::int64_t bytes, Draw draw,
                                                            bool strict);
[[nodiscard]] UnitConditions unit_conditions(const Profile& profile, const UnitModel& unit,
                                             Draw draw, bool strict);

}  // namespace pirt
