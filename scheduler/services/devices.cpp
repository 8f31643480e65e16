#include "scheduler/services/devices.h"

#include <algorithm>
#include <utility>

namespace pirt {
namespace {

/// Of the newest run that had the meter.
void take_metered_idle(const Profile& profile, UnitModel& unit) {
  if (unit.idle_set || unit.standing_w() > 0) return;
  const std::string meter = "meter." + unit.name;
  for (const RunInfo& run : profile.runs) {
    const auto rest_w = run.figure(meter + ".idle_w");
    const auto awake_w = run.figure(meter + ".awake_w");
    if (!rest_w || !awake_w) continue;
    unit.idle_w = *rest_w;
    unit.held_w = std::max(0.0, *awake_w - *rest_w);
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
