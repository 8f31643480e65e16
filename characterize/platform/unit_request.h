// What a backend is told about a unit of a platform.
#pragma once

#include <string>

#include "characterize/platform/platform.h"
#include "workloads/model/backend.h"

namespace pirt {

/// @param reference_folder  Where the fake backend may find references that are computed already;
/// empty = nowhere.
/// @throws Error{kBadInput} if a stage of a fake unit is not called upload, launch, execute or
/// download (an unnamed one is execute), or its
///         script is malformed. The script's own `stages` go before the platform's.
[[nodiscard]] UnitRequest make_unit_request(const Platform& platform, const UnitModel& unit,
                                            const std::string& reference_folder = "");

}  // namespace pirt
