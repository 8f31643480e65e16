#include "scheduler/policies/unit_order.h"

namespace pirt {

std::vector<Role> roles_of(const Platform& platform) {
  std::vector<Role> roles;
  for (const auto& unit : platform.units) roles.push_back(unit.role);
  return roles;
}

std::vector<UnitId> units_by_role(std::span<const Role> roles, std::span<const Role> order) {
  std::vector<UnitId> units;
  for (const auto role : order) {
    for (UnitId unit = 0; unit < roles.size(); ++unit) {
      if (roles[unit] == role) units.push_back(unit);
    }
  }
  return units;
}

UnitMask local_units(std::span<const Role> roles) {
  return units_where(roles, [](Role role) { return role != Role::kCloud; });
}

std::optional<UnitId> else_target(std::span<const UnitId> order, std::span<const Role> roles,
                                  Role role, UnitMask mask) {
  std::optional<UnitId> named;
  std::optional<UnitId> last;
  for (const UnitId unit : order) {
    if (!contains(mask, unit)) continue;
    last = unit;
    if (roles[unit] == role) named = unit;
  }
  return named ? named : last;
}

}  // namespace pirt
