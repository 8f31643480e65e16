// Which meter a unit's energy is read from.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "characterize/energy/meter.h"
#include "characterize/platform/platform.h"

namespace pirt {

/// What the choice depends on.
struct MeterUser {
  const UnitModel& unit;
  bool device_is_cpu = false;  ///< It computes on the host's own cores.
  bool simulated = false;      ///< It computes nothing, and meters show somebody else's energy.
  std::string pci = {};        ///< The board that it is, as MeterInfo::pci; empty = not known.
  bool has_model = true;       ///< The platform states what it draws: Platform::states_power.
};

struct MeterChoice {
  std::vector<const Meter*> meters;  ///< To be added up; empty = the model.
  std::string remark;  ///< Why there is none, or why not the one that comes first, with the remedy.
};

/// The meters that the platform file names, or else the widest that covers the unit, since what a
/// call costs the robot is what leaves its battery. For the host's cores: their packages, the
/// board's input, the battery; for a device with a meter of its own PCI address: that one alone;
/// for any other device: the board's input, the GPU's sensor, the battery. Simulated devices have
/// one only if the platform file names it.
///
/// @param sys  Where packages are looked up by core.
/// @throws Error{kBadInput} as find_meters; Error{kEnvironment} if the platform file names a meter
/// that cannot be read.
[[nodiscard]] MeterChoice choose_meters(const MeterDiscovery& found, const MeterUser& user,
                                        const std::filesystem::path& sys);

}  // namespace pirt
