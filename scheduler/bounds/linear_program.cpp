#include "scheduler/bounds/linear_program.h"

#include <coin/Clp_C_Interface.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <coin/CoinFinite.hpp>
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

/// Clp's word for "no limit".
double limit(double value) {
  if (value == LinearProgram::kUnlimited) return COIN_DBL_MAX;
  return value == -LinearProgram::kUnlimited ? -COIN_DBL_MAX : value;
}

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

void LinearProgram::add_row(Terms terms, double low, double high, std::optional<int> guess) {
  rows_.push_back({std::move(terms), low, high, guess});
}

/// Columns, then rows: each row's slack makes it up, or the variable that was guessed.
std::vector<unsigned char> LinearProgram::first_basis() const {
  constexpr unsigned char kBasic = 1;
  constexpr unsigned char kAtLowerBound = 3;
  std::vector<unsigned char> statuses(costs_.size(), kAtLowerBound);
  statuses.resize(costs_.size() + rows_.size(), kBasic);
  for (std::size_t row = 0; row < rows_.size(); ++row) {
    if (!rows_[row].guess) continue;
    statuses[static_cast<std::size_t>(*rows_[row].guess)] = kBasic;
    statuses[costs_.size() + row] = kAtLowerBound;
  }
  return statuses;
}

std::optional<LinearProgram::Solution> LinearProgram::solve() const {
  const std::unique_ptr<Clp_Simplex, DeleteModel> model(Clp_newModel());
  Clp_setLogLevel(model.get(), kQuiet);
  Clp_setPrimalTolerance(model.get(), kTolerance);
  Clp_setDualTolerance(model.get(), kTolerance);
  // Empty columns first, then the rows with their coefficients.
  std::vector<double> lowers(costs_.size(), 0.0);
  std::vector<double> uppers;
  for (const double upper : uppers_) uppers.push_back(limit(upper));
  const std::vector<CoinBigIndex> starts(costs_.size() + 1, 0);
  Clp_addColumns(model.get(), static_cast<int>(costs_.size()), lowers.data(), uppers.data(),
                 costs_.data(), starts.data(), nullptr, nullptr);
  std::vector<double> row_lowers, row_uppers, elements;
  std::vector<int> columns;
  std::vector<CoinBigIndex> row_starts = {0};
  for (const Row& row : rows_) {
    row_lowers.push_back(limit(row.low));
    row_uppers.push_back(limit(row.high));
    for (const auto& [variable, coefficient] : row.terms) {
      columns.push_back(variable);
      elements.push_back(coefficient);
    }
    row_starts.push_back(static_cast<CoinBigIndex>(columns.size()));
  }
  Clp_addRows(model.get(), static_cast<int>(rows_.size()), row_lowers.data(), row_uppers.data(),
              row_starts.data(), columns.data(), elements.data());
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
