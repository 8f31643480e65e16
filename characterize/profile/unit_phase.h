// What is measured of a unit beside its calls.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "workloads/base/time.h"

namespace pirt {

/// Of units that are threads of the host; no part of `call`.
enum class UnitPhase : std::uint8_t {
  kHandover,    ///< From handing a call to the unit until it begins, after so long a sleep.
  kLeave,       ///< From leaving a call between two slices until it goes on, less what was let in.
  kReread,      ///< Reading part of the last cache's bytes again, after so long a sleep,
  kRereadCold,  ///< or after as many others as that cache holds.
};
inline constexpr std::array kAllUnitPhases = {UnitPhase::kHandover, UnitPhase::kLeave,
                                              UnitPhase::kReread, UnitPhase::kRereadCold};

/// "handover", "leave", "reread", "reread_cold": `phase` in view unit_time_summary.
[[nodiscard]] std::string_view to_string(UnitPhase phase);
[[nodiscard]] std::optional<UnitPhase> unit_phase_from_string(std::string_view text);

/// How often to measure what follows so long a sleep.
struct SleepPlan {
  Nanos sleep{0};
  int samples = 0;
};

}  // namespace pirt
