// Energy of one call from a model: watts, picojoules and joules that the platform states, and the
// measured time of the call.
//
// No meter is read here (metered_calls.h).
#pragma once

#include <span>

#include "characterize/platform/platform.h"
#include "characterize/profile/records.h"
#include "workloads/model/workload.h"

namespace pirt {

inline constexpr double kPico = 1e-12;

/// What the platform states of a call beside the unit's own figures: the workload's call_j, and the
/// link's joules for inputs and outputs, lists as if they were full.
[[nodiscard]] double stated_j(const Platform& platform, const UnitModel& unit,
                              const Workload& workload);

/// active_w * mean call + op_pj * operations + byte_pj * bytes + call_j + the link's active_w * the
/// time that inputs and outputs take over it, with the terms that the platform gives: what the call
/// adds to the idle power. The mean, since joules of calls add up: a robot that makes n calls uses
/// n times this. Provenance `modelled`, or `fitted` where the platform says so, or that of the time
/// if it is weaker; the source lists every input.
///
/// @param call  The row of phase `call`. Where it is not valid neither is the energy, for the same
/// reasons; without samples there is none.
/// @return      Without energy and with reason no_power if the platform states nothing for the unit
/// (0 J would look like a figure), or
///              ops_unknown if op_pj is given but the workload's operations depend on the data.
/// @param work  Of a call, the mean over the workload's sequence; by default what holds for all
/// data.
/// @param phases  The cell's rows, for a unit that draws active_w in some of them only
/// (platform/elsewhere.h).
[[nodiscard]] EnergyRecord model_energy(const Platform& platform, const UnitModel& unit,
                                        const Workload& workload, const PhaseRecord& call,
                                        const std::optional<CallWork>& work = std::nullopt,
                                        std::span<const PhaseRecord> phases = {});

}  // namespace pirt
