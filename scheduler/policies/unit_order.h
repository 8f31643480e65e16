// Algorithms 1 to 3 on platforms other than the paper's: which units its words GPU, DSP and CPU
// stand for, and in what order.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "characterize/platform/platform.h"
#include "scheduler/mix/task.h"

namespace pirt {

/// The orders in which the algorithms ask, by role. Roles that the paper does not have go beside
/// the DSP, the accelerator that they are most like: `fpga` after `dsp`, `other` after both. The
/// cloud is in none: the basic scheduler "does not have cloud awareness".
inline constexpr Role kLatencyOrder[] = {Role::kGpu, Role::kDsp, Role::kFpga, Role::kOther,
                                         Role::kCpu};
inline constexpr Role kThroughputOrder[] = {Role::kGpu, Role::kCpu, Role::kDsp, Role::kFpga,
                                            Role::kOther};
inline constexpr Role kEnergyOrder[] = {Role::kDsp, Role::kFpga, Role::kOther, Role::kGpu,
                                        Role::kCpu};

/// By unit.
[[nodiscard]] std::vector<Role> roles_of(const Platform& platform);

/// Units by role, in the given order of roles; several units of a role in file order.
/// @param roles  By unit.
[[nodiscard]] std::vector<UnitId> units_by_role(std::span<const Role> roles,
                                                std::span<const Role> order);

/// The units that are not of role `cloud`: all that a policy without cloud awareness may use.
[[nodiscard]] UnitMask local_units(std::span<const Role> roles);

/// The unit that an algorithm's printed `else` names, among those of @p mask: the last one of that
/// role, or, where the platform has none that may serve, the last in the algorithm's order. Absent
/// only if @p mask holds no unit of the order.
[[nodiscard]] std::optional<UnitId> else_target(std::span<const UnitId> order,
                                                std::span<const Role> roles, Role role,
                                                UnitMask mask);

}  // namespace pirt
