#include "characterize/energy/fit.h"

#include <ceres/ceres.h>
#include <fmt/core.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "characterize/energy/model.h"
#include "characterize/platform/elsewhere.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

constexpr double kHuberFrom = 0.05;
constexpr double kLargestCondition = 30;
constexpr double kShareOfDependency = 0.3;  // of the vector of the smallest singular value
constexpr double kAtBound = 1e-9;           // of the scaled parameters, whose size is about 1
constexpr std::size_t kSpareCells = 2;

constexpr std::array kAllParameters = {EnergyParameter::kActive, EnergyParameter::kOp,
                                       EnergyParameter::kByte, EnergyParameter::kCall};

/// Joules a call for a parameter of 1.
double term_j(EnergyParameter parameter, const FitCell& cell) {
  switch (parameter) {
    case EnergyParameter::kActive:
      return cell.seconds;
    case EnergyParameter::kOp:
      return kPico * static_cast<double>(cell.ops.value_or(0));
    case EnergyParameter::kByte:
      return kPico * static_cast<double>(cell.bytes);
    case EnergyParameter::kCall:
      return 1;
  }
  return 0;
}

/// Relative error of one cell: row * x - 1, where row holds its scaled terms over its energy.
class RelativeError : public ceres::CostFunction {
 public:
  explicit RelativeError(Eigen::VectorXd row) : row_(std::move(row)) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->push_back(static_cast<std::int32_t>(row_.size()));
  }
  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override {
    const Eigen::Map<const Eigen::VectorXd> x(parameters[0], row_.size());
    residuals[0] = row_.dot(x) - 1;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::VectorXd>(jacobians[0], row_.size()) = row_;
    }
    return true;
  }

 private:
  Eigen::VectorXd row_;
};

/// The scaled linear problem: matrix * x is 1 for every cell; parameter j is x(j) / norm(j).
struct ScaledProblem {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd norm;
};

/// As many rows and columns as there are parameters.
using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 4, 4>;
static_assert(kAllParameters.size() <= 4);

/// The matrix' transpose times it, its rows weighed.
Small gram(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& weights) {
  Small products(matrix.cols(), matrix.cols());
  for (Eigen::Index i = 0; i < matrix.cols(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      products(i, j) = products(j, i) = matrix.col(i).cwiseProduct(weights).dot(matrix.col(j));
    }
  }
  return products;
}

ScaledProblem scale(std::span<const FitCell> cells, std::span<const EnergyParameter> parameters) {
  ScaledProblem problem;
  problem.matrix.resize(static_cast<Eigen::Index>(cells.size()),
                        static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t i = 0; i < cells.size(); ++i) {
    for (std::size_t j = 0; j < parameters.size(); ++j) {
      problem.matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          term_j(parameters[j], cells[i]) / cells[i].energy_j;
    }
  }
  problem.norm = problem.matrix.colwise().norm();
  for (Eigen::Index j = 0; j < problem.norm.size(); ++j) {
    if (problem.norm(j) > 0) problem.matrix.col(j) /= problem.norm(j);
  }
  return problem;
}

std::string names(std::span<const EnergyParameter> parameters) {
  std::vector<std::string> texts;
  for (const auto parameter : parameters) texts.emplace_back(to_string(parameter));
  return join(texts, ", ");
}

/// Fills in why the problem has no one solution, if so.
void refuse_if_undetermined(const ScaledProblem& problem,
                            std::span<const EnergyParameter> parameters, EnergyFit& fit) {
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    if (problem.norm(static_cast<Eigen::Index>(j)) > 0) continue;
    fit.refusal = fmt::format("{} has no effect in any of these cells", to_string(parameters[j]));
    fit.collinear = {parameters[j]};
    return;
  }
  // The squares of the singular values, rising.
  const auto ones = Eigen::VectorXd::Ones(problem.matrix.rows());
  const Eigen::SelfAdjointEigenSolver<Small> eigen(gram(problem.matrix, ones));
  const auto& squares = eigen.eigenvalues();
  fit.condition = squares(0) > 0 ? std::sqrt(squares(squares.size() - 1) / squares(0))
                                 : std::numeric_limits<double>::infinity();
  if (fit.condition <= kLargestCondition) return;
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    if (std::abs(eigen.eigenvectors()(static_cast<Eigen::Index>(j), 0)) > kShareOfDependency) {
      fit.collinear.push_back(parameters[j]);
    }
  }
  fit.refusal = fmt::format(
      "{} cannot be told apart by these {} cells: their terms keep nearly one proportion in all of "
      "them (condition number {:.3g}, at most {:g})",
      names(fit.collinear), problem.matrix.rows(), fit.condition, kLargestCondition);
}

Eigen::VectorXd solve(const ScaledProblem& problem) {
  const auto count = problem.matrix.cols();
  Eigen::VectorXd x = Eigen::VectorXd::Constant(count, 1.0 / static_cast<double>(count));
  ceres::Problem ceres_problem;
  for (Eigen::Index i = 0; i < problem.matrix.rows(); ++i) {
    ceres_problem.AddResidualBlock(new RelativeError(problem.matrix.row(i)),
                                   new ceres::HuberLoss(kHuberFrom), x.data());
  }
  for (int j = 0; j < static_cast<int>(count); ++j) {
    ceres_problem.SetParameterLowerBound(x.data(), j, 0);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.logging_type = ceres::SILENT;
  options.max_num_iterations = 500;
  options.function_tolerance = 1e-14;
  options.gradient_tolerance = 1e-14;
  options.parameter_tolerance = 1e-12;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  if (!summary.IsSolutionUsable()) {
    throw_environment("fitting the energy model failed: " + summary.message);
  }
  return x;
}

/// From the weighted residuals, over the parameters that are not at their bound; asymptotic.
std::vector<std::optional<double>> standard_errors(const ScaledProblem& problem,
                                                   const Eigen::VectorXd& x) {
  std::vector<Eigen::Index> free;
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    if (x(j) > kAtBound) free.push_back(j);
  }
  std::vector<std::optional<double>> errors(static_cast<std::size_t>(x.size()));
  if (free.empty()) return errors;
  const Eigen::VectorXd residuals = (problem.matrix.lazyProduct(x)).array() - 1.0;
  const Eigen::VectorXd weights = residuals.unaryExpr(
      [](double r) { return std::abs(r) <= kHuberFrom ? 1.0 : kHuberFrom / std::abs(r); });
  Eigen::MatrixXd used(problem.matrix.rows(), std::ssize(free));
  for (Eigen::Index k = 0; k < used.cols(); ++k) {
    used.col(k) = problem.matrix.col(free[static_cast<std::size_t>(k)]);
  }
  const double freedom = static_cast<double>(used.rows() - used.cols());
  const double variance = residuals.cwiseAbs2().dot(weights) / freedom;
  const Eigen::SelfAdjointEigenSolver<Small> eigen(gram(used, weights));
  for (std::size_t k = 0; k < free.size(); ++k) {
    // Of the inverse, on its diagonal.
    const auto row = eigen.eigenvectors().row(static_cast<Eigen::Index>(k)).array();
    const double inverse = (row.square() / eigen.eigenvalues().transpose().array()).sum();
    errors[static_cast<std::size_t>(free[k])] =
        std::sqrt(variance * inverse) / problem.norm(free[k]);
  }
  return errors;
}

/// What of a mean call draws active_w, as model_energy has it.
double drawing_s(const Profile& profile, const UnitModel& unit, const PhaseRow& call) {
  const auto mean_s = [](const PhaseRow& row) { return to_s(row.mean.value_or(*row.median)); };
  if (!is_elsewhere(unit)) return mean_s(call);
  double sum_s = 0;
  for (const PhaseRow& row : profile.phases) {
    const bool draws = row.workload == call.workload && row.unit == call.unit &&
                       row.run_id == call.run_id && draws_in(unit, row.phase);
    if (draws && row.median) sum_s += mean_s(row);
  }
  return sum_s;
}

}  // namespace

std::string_view to_string(EnergyParameter parameter) {
  constexpr std::array<std::string_view, 4> kNames = {"active_w", "op_pj", "byte_pj", "call_j"};
  return kNames.at(static_cast<std::size_t>(parameter));
}

std::string_view unit_of(EnergyParameter parameter) {
  constexpr std::array<std::string_view, 4> kUnits = {"W", "pJ", "pJ", "J"};
  return kUnits.at(static_cast<std::size_t>(parameter));
}

std::vector<EnergyParameter> parse_energy_parameters(const std::string& text) {
  std::vector<std::string> known;
  for (const auto parameter : kAllParameters) known.emplace_back(to_string(parameter));
  std::vector<EnergyParameter> parameters;
  for (const auto& word : split(text, ',')) {
    const auto it = std::ranges::find(known, word);
    if (it == known.end()) {
      throw_bad_input("'" + word + "' is no parameter of the energy model" +
                      suggestion(word, known) + "; they are " + join(known, ", "));
    }
    const auto parameter = kAllParameters.at(static_cast<std::size_t>(it - known.begin()));
    if (std::ranges::find(parameters, parameter) != parameters.end()) {
      throw_bad_input("parameter '" + word + "' is given twice");
    }
    parameters.push_back(parameter);
  }
  return parameters;
}

EnergyFit fit_energy(std::span<const FitCell> cells, std::span<const EnergyParameter> parameters) {
  EnergyFit fit;
  const bool needs_ops = std::ranges::find(parameters, EnergyParameter::kOp) != parameters.end();
  std::vector<FitCell> used;
  for (const FitCell& cell : cells) {
    if (needs_ops && !cell.ops) {
      fit.left_out.push_back(cell.workload);
    } else {
      used.push_back(cell);
    }
  }
  if (used.size() < parameters.size() + kSpareCells) {
    fit.refusal = fmt::format("{} usable cells are too few for {} ({} are needed)", used.size(),
                              names(parameters), parameters.size() + kSpareCells);
    return fit;
  }
  const ScaledProblem problem = scale(used, parameters);
  refuse_if_undetermined(problem, parameters, fit);
  if (!fit.refusal.empty()) return fit;

  const Eigen::VectorXd x = solve(problem);
  const auto errors = standard_errors(problem, x);
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const auto at = static_cast<Eigen::Index>(j);
    const bool at_bound = x(at) <= kAtBound;
    fit.parameters.push_back({parameters[j], at_bound ? 0 : x(at) / problem.norm(at), errors[j]});
  }
  for (const FitCell& cell : used) {
    double fitted_j = 0;
    for (const auto& each : fit.parameters) fitted_j += each.value * term_j(each.parameter, cell);
    fit.residuals.push_back({cell.workload, cell.energy_j, fitted_j});
  }
  return fit;
}

EnergyFit fit_energy_parameters(std::span<const FitCell> cells, std::vector<std::string>& dropped) {
  std::vector<EnergyParameter> parameters(kAllParameters.begin(), kAllParameters.end());
  while (true) {
    EnergyFit fit = fit_energy(cells, parameters);
    if (fit.refusal.empty() || parameters.size() == 1) return fit;
    // Too few cells: whichever is the last. Otherwise the last of those that depend on each other.
    const auto drop = fit.collinear.empty() ? parameters.back() : fit.collinear.back();
    dropped.push_back(fmt::format("{} is not fitted: {}", to_string(drop), fit.refusal));
    std::erase(parameters, drop);
  }
}

std::vector<FitCell> fit_cells(const Profile& profile, const Platform& platform,
                               const UnitModel& unit) {
  std::vector<FitCell> cells;
  for (const EnergyRow& energy : profile.energies) {
    if (energy.run_id != profile.runs.front().run_id) continue;
    if (energy.unit != unit.name || energy.provenance != Provenance::kMeasured || !is_used(energy))
      continue;
    const PhaseRow* call = profile.find(energy.workload, unit.name, Phase::kCall);
    if (call == nullptr || !is_used(*call) || call->run_id != energy.run_id) continue;
    const Workload* const workload = try_find_workload(energy.workload);
    const double stated = workload != nullptr ? stated_j(platform, unit, *workload) : 0;
    const double own_j = energy.energy_j.value() - stated;
    if (own_j <= 0) continue;
    cells.push_back(
        {energy.workload, drawing_s(profile, unit, *call), call->ops, call->bytes, own_j});
  }
  return cells;
}

}  // namespace pirt
