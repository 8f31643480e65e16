#include "scheduler/bounds/linear_program.h"

#include <coin/Clp_C_Interface.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <memory>

namespace pirt {
namespace {

constexpr double kTolerance = 1e-9;
constexpr int kQuiet = 0;
constexpr int kOptimal = 0;

struct DeleteModel {
  void operator()(Clp_Simplex* model) const { Clp_deleteModel(model); }
};

/// Of a number, the digits that the tolerance leaves. What follows them depends on the processor
/// that Clp was compiled for, and bounds and plans are to be the same on all.
double known_digits(double value) {
  constexpr int kAfterThePoint = 11;
  std::array<char, 32> text{};
  const auto written = std::to_chars(text.data(), text.data() + text.size(), value,
                                     std::chars_format::scientific, kAfterThePoint);
  std::from_chars(text.data(), written.ptr, value);
  return value;
}

}  // namespace

int LinearProgram::add_variable(double cost, double upper) {
  costs_.push_back(cost);
  uppers_.push_back(upper);
  return static_cast<int>(costs_.size()) - 1;
}

void LinearProgram::add_row(const Terms& terms, double low, double high, std::optional<int> guess) {
  lows_.push_back(low);
  highs_.push_back(high);
  guesses_.push_back(guess);
  for (const auto& [variable, coefficient] : terms) {
    variables_.push_back(variable);
    coefficients_.push_back(coefficient);
  }
  starts_.push_back(static_cast<int>(variables_.size()));
}

/// Columns, then rows: each row's slack makes it up, or the variable that was guessed.
std::vector<unsigned char> LinearProgram::first_basis() const {
  constexpr unsigned char kBasic = 1;
  constexpr unsigned char kAtLowerBound = 3;
  std::vector<unsigned char> statuses(costs_.size(), kAtLowerBound);
  for (const auto& guess : guesses_) {
    statuses.push_back(guess ? kAtLowerBound : kBasic);
    if (guess) statuses[static_cast<std::size_t>(*guess)] = kBasic;
  }
  return statuses;
}

std::optional<LinearProgram::Solution> LinearProgram::solve() const {
  const std::unique_ptr<Clp_Simplex, DeleteModel> model(Clp_newModel());
  Clp_setLogLevel(model.get(), kQuiet);
  Clp_setPrimalTolerance(model.get(), kTolerance);
  Clp_setDualTolerance(model.get(), kTolerance);
  // Empty columns first, then the rows with their coefficients.
  const std::vector<double> lowers(costs_.size(), 0.0);
  const std::vector<CoinBigIndex> starts(costs_.size() + 1, 0);
  Clp_addColumns(model.get(), static_cast<int>(costs_.size()), lowers.data(), uppers_.data(),
                 costs_.data(), starts.data(), nullptr, nullptr);
  Clp_addRows(model.get(), static_cast<int>(lows_.size()), lows_.data(), highs_.data(),
              starts_.data(), variables_.data(), coefficients_.data());
  Clp_copyinStatus(model.get(), first_basis().data());
  // What Clp chooses by itself takes 6 s more for a graph of 10,000 tasks. Without presolve, which
  // would forget where to start.
  constexpr int kNoValuesPass = 0;
  Clp_primal(model.get(), kNoValuesPass);
  if (Clp_status(model.get()) != kOptimal) return std::nullopt;
  const double* found = Clp_getColSolution(model.get());
  Solution solution{.minimum = known_digits(Clp_objectiveValue(model.get())), .values = {}};
  solution.values.reserve(costs_.size());
  std::transform(found, found + std::ssize(costs_), std::back_inserter(solution.values),
                 known_digits);
  return solution;
}

}  // namespace pirt
