#include "scheduler/policies/unit_order.h"

namespace pirt {

std::vector<UnitId> units_by_role(std::span<const std::string> roles,
                                  std::span<const std::string_view> order) {
  std::vector<UnitId> units;
  for (const auto role : order) {
    for (UnitId unit = 0; unit < roles.size(); ++unit) {
      if (roles[unit] == role) units.push_back(unit);
    }
  }
  return units;
}

UnitMask local_units(std::span<const std::string> roles) {
  UnitMask mask = 0;
  for (UnitId unit = 0; unit < roles.size(); ++unit) {
    if (roles[unit] != "cloud") mask |= unit_bit(unit);
  }
  return mask;
}

std::optional<UnitId> else_target(std::span<const UnitId> order, std::span<const std::string> roles,
                                  std::string_view role, UnitMask mask) {
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
