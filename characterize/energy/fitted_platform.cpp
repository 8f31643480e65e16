#include "characterize/energy/fitted_platform.h"

#include <fmt/core.h>

#include <algorithm>

namespace pirt {
namespace {

double parameter_value(const EnergyFit& fit, EnergyParameter parameter) {
  const auto it = std::ranges::find(fit.parameters, parameter, &FittedParameter::parameter);
  return it == fit.parameters.end() ? 0 : it->value;
}

}  // namespace

std::vector<UnitFit> fit_units(const Profile& profile, const Platform& platform,
                               std::span<const EnergyParameter> parameters) {
  std::vector<UnitFit> fits;
  const RunInfo& run = profile.runs.front();
  for (const UnitRecord& unit : run.units) {
    const auto meter = run.environment.find("meter." + unit.unit);
    if (meter == run.environment.end()) continue;
    UnitFit result;
    result.unit = unit.unit;
    result.meter = meter->second;
    result.run = fmt::format("run {} of {}", run.run_id, run.started);
    if (const auto standing = standing_power(run, unit.unit)) {
      result.idle_w = standing->idle_w;
      result.held_w = standing->held_w;
    }
    const auto cells = fit_cells(profile, platform, platform.unit(unit.unit));
    result.fit = parameters.empty() ? fit_energy_parameters(cells, result.dropped)
                                    : fit_energy(cells, parameters);
    fits.push_back(std::move(result));
  }
  return fits;
}

std::vector<YamlOverride> fitted_settings(std::span<const UnitFit> fits) {
  std::vector<YamlOverride> settings;
  for (const UnitFit& each : fits) {
    if (!each.fit.refusal.empty()) continue;
    const auto value = [&each](EnergyParameter parameter) {
      return fmt::format("{:.6g}", parameter_value(each.fit, parameter));
    };
    settings.push_back({each.unit + ".active_w", value(EnergyParameter::kActive)});
    if (each.idle_w)
      settings.push_back({each.unit + ".idle_w", fmt::format("{:.6g}", *each.idle_w)});
    if (each.held_w)
      settings.push_back({each.unit + ".held_w", fmt::format("{:.6g}", *each.held_w)});
    settings.push_back({each.unit + ".energy",
                        fmt::format("{{op_pj: {}, byte_pj: {}, call_j: {}, provenance: fitted, "
                                    "source: 'fitted to {} cells of {}, {}'}}",
                                    value(EnergyParameter::kOp), value(EnergyParameter::kByte),
                                    value(EnergyParameter::kCall), each.fit.residuals.size(),
                                    each.meter, each.run)});
  }
  return settings;
}

}  // namespace pirt
