#include "characterize/energy/fitted_platform.h"

#include <fmt/core.h>

#include <algorithm>

namespace pirt {
namespace {

std::optional<std::string> fact(const RunInfo& run, const std::string& key) {
  const auto it = run.environment.find(key);
  if (it == run.environment.end()) return std::nullopt;
  return it->second;
}

/// Units that share a meter share its idle power, so that the platform's sum is what was measured.
std::optional<double> idle_share_w(const RunInfo& run, const std::string& unit,
                                   const std::string& meter) {
  const auto idle_w = run.figure("meter." + unit + ".idle_w");
  if (!idle_w) return std::nullopt;
  const auto sharing = std::ranges::count_if(run.units, [&](const UnitRecord& other) {
    return fact(run, "meter." + other.unit) == meter;
  });
  return *idle_w / static_cast<double>(std::max<std::ptrdiff_t>(1, sharing));
}

double value_of(const EnergyFit& fit, EnergyParameter parameter) {
  const auto it = std::ranges::find(fit.parameters, parameter, &FittedParameter::parameter);
  return it == fit.parameters.end() ? 0 : it->value;
}

}  // namespace

std::vector<UnitFit> fit_units(const Profile& profile,
                               std::span<const EnergyParameter> parameters) {
  std::vector<UnitFit> fits;
  const RunInfo& run = profile.runs.front();
  for (const UnitRecord& unit : run.units) {
    const auto meter = fact(run, "meter." + unit.unit);
    if (!meter) continue;
    UnitFit result;
    result.unit = unit.unit;
    result.meter = *meter;
    result.run = fmt::format("run {} of {}", run.run_id, run.started);
    result.idle_w = idle_share_w(run, unit.unit, *meter);
    const auto awake_w = run.figure("meter." + unit.unit + ".awake_w");
    if (result.idle_w && awake_w) result.held_w = std::max(0.0, *awake_w - *result.idle_w);
    const auto cells = fit_cells(profile, unit.unit);
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
      return fmt::format("{:.6g}", value_of(each.fit, parameter));
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
