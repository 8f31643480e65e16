#include "scheduler/services/devices.h"

#include <algorithm>
#include <utility>

namespace pirt {
namespace {

/// Of the newest run that had the meter.
void take_metered_idle(const Profile& profile, UnitModel& unit) {
  if (unit.idle_set || unit.held_set || unit.standing_w() > 0) return;
  for (const RunInfo& run : profile.runs) {
    const auto standing = standing_power(run, unit.name);
    if (!standing || !standing->held_w) continue;
    unit.idle_w = standing->idle_w;
    unit.held_w = *standing->held_w;
    return;
  }
}

}  // namespace

Platform on_devices(Platform platform, const Profile* profile,
                    std::span<const std::string> without) {
  for (UnitModel& unit : platform.units) {
    const UnitRecord* device = profile == nullptr ? nullptr : profile->find_unit(unit.name);
    if (device != nullptr) {
      unit = on_device(std::move(unit), device->device_is_cpu);
      if (!device->device_is_cpu) take_metered_idle(*profile, unit);
    }
    if (std::ranges::find(without, unit.name) != without.end()) unit.held_w = 0;
  }
  return platform;
}

}  // namespace pirt
