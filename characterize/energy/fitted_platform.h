// The energy models of a run's units, fitted to what their meters showed, and a platform with them.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "characterize/energy/fit.h"
#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"

namespace pirt {

struct UnitFit {
  std::string unit;
  std::string meter;  ///< "rapl: package-0 (package)"
  std::string run;    ///< "run 3 of 2026-11-21T04:43:05Z"
  EnergyFit fit;
  std::vector<std::string> dropped;           ///< Parameters that were left out, and why.
  std::optional<double> idle_w, held_w = {};  ///< StandingPower
};

/// One entry for each unit of the newest run that had a meter.
/// @param platform    That the run measured.
/// @param parameters  Exactly these; empty = as many as each unit's cells can tell apart.
[[nodiscard]] std::vector<UnitFit> fit_units(const Profile& profile, const Platform& platform,
                                             std::span<const EnergyParameter> parameters);

/// The settings of the units that were fitted: active_w, idle_w, and `energy` with provenance
/// fitted and its source. Terms that were not fitted become 0: the others explain the whole energy.
[[nodiscard]] std::vector<YamlOverride> fitted_settings(std::span<const UnitFit> fits);

}  // namespace pirt
