// Fitting the parameters of the energy model to metered calls: which watts, picojoules and joules
// explain what the meters showed, and which of them these cells cannot tell apart.
//
// Solved with Ceres, which nothing outside fit.cpp includes.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"

namespace pirt {

/// Terms of model_energy, as the platform file names them.
enum class EnergyParameter : std::uint8_t {
  kActive,  ///< active_w, watts: times the seconds of a call.
  kOp,      ///< op_pj, picojoules: times its operations.
  kByte,    ///< byte_pj, picojoules: times its bytes.
  kCall,    ///< call_j, joules: once a call.
};
[[nodiscard]] std::string_view to_string(EnergyParameter parameter);
/// "W", "pJ", "pJ", "J".
[[nodiscard]] std::string_view unit_of(EnergyParameter parameter);
/// "active_w,op_pj". @throws Error{kBadInput}: an unknown one, one given twice, none.
[[nodiscard]] std::vector<EnergyParameter> parse_energy_parameters(const std::string& text);

/// What was measured of one workload on the unit.
struct FitCell {
  std::string workload;
  double seconds = 0;               ///< What of a mean call draws active_w.
  std::optional<std::int64_t> ops;  ///< Absent where they depend on the data.
  std::int64_t bytes = 0;
  double energy_j = 0;  ///< A call, without idle and stated_j (model.h); above 0.
};

struct FittedParameter {
  EnergyParameter parameter = EnergyParameter::kActive;
  double value = 0;                      ///< In its unit; 0 or more.
  std::optional<double> standard_error;  ///< Absent if it ended at its bound 0.
};

struct FitResidual {
  std::string workload;
  double measured_j = 0;
  double fitted_j = 0;
  [[nodiscard]] double relative_error() const { return fitted_j / measured_j - 1; }
};

struct EnergyFit {
  std::vector<FittedParameter> parameters;  ///< As asked for; empty if refused.
  std::vector<FitResidual> residuals;       ///< Of the cells used.
  std::vector<std::string> left_out;        ///< Workloads whose operations are not known.
  double condition = 0;                     ///< Of the scaled problem; 0 if refused before.
  std::string refusal;                      ///< Why there are no parameters; empty if there are.
  std::vector<EnergyParameter> collinear;   ///< If refused for that: those not told apart.
};

/// Least squares of the relative errors, with Huber's loss from 5 % on, so that single cells do not
/// pull the rest; parameters bounded below by 0; columns scaled to norm 1.
///
/// Refused: fewer than two cells more than parameters; a parameter whose term is 0 in every cell;
/// parameters whose terms keep (nearly) one proportion, which is a condition number above 30
/// (Belsley, Kuh, Welsch: Regression Diagnostics, 1980, section 3.2: above it, dependencies do
/// harm).
[[nodiscard]] EnergyFit fit_energy(std::span<const FitCell> cells,
                                   std::span<const EnergyParameter> parameters);

/// As many of all four as the cells can tell apart: where they cannot, the last one of those goes.
/// @param dropped  What was left out and why, one line each.
[[nodiscard]] EnergyFit fit_energy_parameters(std::span<const FitCell> cells,
                                              std::vector<std::string>& dropped);

/// The metered rows of a unit in the newest run that are used, with the times and sizes of that
/// run.
[[nodiscard]] std::vector<FitCell> fit_cells(const Profile& profile, const Platform& platform,
                                             const UnitModel& unit);

}  // namespace pirt
