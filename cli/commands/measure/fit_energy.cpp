#include "cli/commands/measure/fit_energy.h"

#include <fmt/core.h>

#include <algorithm>

#include "characterize/energy/fitted_platform.h"
#include "reports/tools/fit_report.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

std::vector<EnergyParameter> parameters_of(const FitOptions& options) {
  if (!options.parameters) return {};
  return parse_energy_parameters(*options.parameters);
}

std::string file_text(const CampaignOptions& campaign, const std::vector<UnitFit>& fits) {
  return fmt::format(
      "# Platform {} with energy models fitted by: pirt characterize --fit-energy\n{}",
      campaign.platform.name, platform_text(campaign.platform, fitted_settings(fits)));
}

}  // namespace

void check_fit(const FitOptions& options, const CampaignPlan& plan) {
  if (!options.file) return;
  if (!names_a_file(options.file.path())) {
    throw_bad_input("--fit-energy '" + options.file.path() +
                    "' could not be given to --platform later; end it in .yaml");
  }
  static_cast<void>(parameters_of(options));
  if (plan.meters.empty()) {
    throw_environment(
        "--fit-energy has nothing to fit to: no unit has an energy meter (see: pirt list meters; "
        "choose one with --set UNIT.meter=NAME)");
  }
}

FitOutcome fit_run(const FitOptions& options, const CampaignOptions& campaign,
                   const Profile& profile) {
  const auto fits = fit_units(profile, campaign.platform, parameters_of(options));
  const auto is_fitted = [](const UnitFit& each) { return each.fit.refusal.empty(); };
  FitOutcome outcome;
  outcome.tables = fit_tables(fits);
  outcome.json = fit_json(fits);
  outcome.complete = !fits.empty() && std::ranges::all_of(fits, is_fitted);
  if (std::ranges::any_of(fits, is_fitted)) {
    emit_text(file_text(campaign, fits), options.file);
    outcome.tables.back().footnotes.push_back(fmt::format(
        "Use the fitted platform with: --platform {}{}",
        options.file.path().find('/') == std::string::npos ? "./" : "", options.file.path()));
  }
  return outcome;
}

}  // namespace pirt::cli
