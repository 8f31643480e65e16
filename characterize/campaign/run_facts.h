// What a run of the profile says of itself before anything is measured: machine, build, inputs,
// units.
#pragma once

#include <filesystem>
#include <string>

#include "characterize/machine/environment.h"
#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/backend.h"

namespace pirt {

/// Now, ISO 8601.
[[nodiscard]] std::string utc_now();

/// Of the machine as it is now, the build, the pictures and the platform.
/// @param program  What measures.
[[nodiscard]] Environment run_facts(const Platform& platform, const ImageSource& images,
                                    const std::filesystem::path& program = "/proc/self/exe");

[[nodiscard]] UnitRecord unit_record(const UnitModel& unit, const DeviceInfo& device);
/// "unit.gpu.version" and so on.
[[nodiscard]] Environment unit_facts(const UnitModel& unit, const DeviceInfo& device);

}  // namespace pirt
