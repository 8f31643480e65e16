// What gives first: a rate is raised, or a cap of power lowered, until a mode keeps no longer what
// the mix wants, in virtual time.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "scheduler/mix/mix.h"
#include "scheduler/policies/setup.h"
#include "scheduler/record/run_record.h"

namespace pirt {

/// Why a run does not keep what the mix wants: the pipeline that is worst off, the busiest unit
/// that served it, and what there was too little of.
struct Breakage {
  std::string pipeline = {};  ///< Empty where it is none of one pipeline.
  std::string unit = {};      ///< Empty if none served it.
  std::string resource;       ///< "image buffers", "power", "time of the unit", "its turn ...".
  std::string what;           ///< "31 of 1500 late", "rate 18.5 of 25 Hz".
};

/// Absent if the run keeps up (record/keeping_up.h), and no second draws more than the cap.
/// @param mix  Of the run.
[[nodiscard]] std::optional<Breakage> breakage_of(const RunRecord& run, const Mix& mix,
                                                  std::optional<double> power_cap_w);

/// What is changed.
struct WhatIfChange {
  enum class Kind : std::uint8_t { kRate, kPowerCap };
  Kind kind = Kind::kRate;
  std::string pipeline;  ///< Of kRate; "all" = of every pipeline with a rate, together.
};
/// "localization.rate_hz", "all.rate_hz". @throws Error{kBadInput} with the nearest name.
[[nodiscard]] WhatIfChange parse_raise(const std::string& text, const Mix& mix);

struct WhatIfRow {
  std::string mode;
  std::string not_run = {};          ///< Why not; empty = it was.
  std::optional<double> holds = {};  ///< The last value that was found to hold,
  /// the same where all calls take as long, or as short, as the intervals of a measured profile let
  /// them (absent without such, or where none is found),
  std::optional<double> holds_if_long = {}, holds_if_short = {};
  std::optional<double> breaks = {};       ///< and the first that was not. Absent: none was found.
  std::optional<Breakage> breakage = {};   ///< At `breaks`.
  std::vector<std::string> warnings = {};  ///< Of its first run.
};

struct WhatIf {
  std::string parameter;  ///< "localization.rate_hz", "all rates, times", "power cap".
  std::string unit;       ///< "Hz", "x", "W".
  double given = 0;
  double last_tried = 0;  ///< As far as was tried.
  std::vector<WhatIfRow> rows;
};

/// Steps of 5 % of the given value, up to four times it or down to nothing, and then bisection to a
/// five-hundredth within the first step that fails, since more can be better.
/// @param options  Its mode is not looked at; what only mode budget has is for that one.
/// @throws Error{kBadInput} as run_virtual, and for a cap to lower that is not given.
[[nodiscard]] WhatIf what_if(const Platform& platform, const Profile* profile, const Mix& mix,
                             const std::vector<std::string>& modes, const WhatIfChange& change,
                             const ScheduleOptions& options);

}  // namespace pirt
