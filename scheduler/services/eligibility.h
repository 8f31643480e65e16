// Which units may serve which task of a mix, and the errors for those that nobody can serve.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "scheduler/mix/mix.h"
#include "scheduler/mix/task.h"
#include "scheduler/services/services.h"

namespace pirt {

/// The workloads of the mix, each once, in order of first appearance: the position is the
/// WorkloadId.
[[nodiscard]] std::vector<std::string> workloads_of(const Mix& mix);

/// The times that the mix itself gives to tasks, by unit. A unit's own name goes before its role.
/// @throws Error{kBadInput} with file:line if a key names neither a unit nor a role, or if the
/// platform has a unit for none of them.
[[nodiscard]] GivenServices given_services(const Platform& platform, const Mix& mix);

/// Which tasks a mode may give to the cloud.
enum class CloudUse : std::uint8_t { kNone, kNotRealTime, kAll };

[[nodiscard]] UnitMask cloud_units(const Platform& platform);

/// @throws Error{kBadInput} if no unit has a service for some workload that the mode could use:
/// which, each unit's reason, and the command that
///         measures it.
void check_every_workload_served(const Platform& platform, const Profile* profile, const Mix& mix,
                                 const ServiceTable& services, CloudUse cloud_use);

/// Of units with `memory_mb`: takes from @p services what does not fit there beside what comes
/// before it, in the order of the mix's tasks, if tasks may go there at all. A unit with contexts
/// holds one at a time. What nobody has measured is not counted, and warned of.
/// @throws Error{kBadInput} if `eligible` names neither a unit nor a role.
void admit_by_memory(const Platform& platform, const Mix& mix, ServiceTable& services);

/// [pipeline][task]: the units that have a service and that `eligible` names, by unit or by role.
/// One whose figure is uncertain by more than a factor of 4 is among them only where nothing else
/// of the robot's own is; the cloud is asked for other reasons than its time.
/// @param only      The role whose units alone the mode uses, if it has one: others serve nothing.
/// @param warnings  Appended to: which is left out so.
/// @throws Error{kBadInput} if `eligible` names neither a unit nor a role, or leaves no unit.
[[nodiscard]] std::vector<std::vector<TaskClass>> task_classes(const Platform& platform,
                                                               const Mix& mix,
                                                               const ServiceTable& services,
                                                               std::optional<Role> only,
                                                               std::vector<std::string>& warnings);

/// "mix m: pipelines.p: task", for messages.
[[nodiscard]] std::string task_name(const Mix& mix, const Pipeline& pipeline, const MixTask& task);
/// "cpu, gpu", for messages.
[[nodiscard]] std::string unit_list(const Platform& platform, UnitMask mask);

}  // namespace pirt
