// A linear programme and its solution; the solver (COIN-OR Clp) is the source file's own business.
#pragma once

#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace pirt {

/// Minimize the sum of cost * x over x >= 0 with rows low <= sum of coefficient * x <= high.
class LinearProgram {
 public:
  using Terms = std::vector<std::pair<int, double>>;  ///< Variable and coefficient.
  static constexpr double kUnlimited = std::numeric_limits<double>::max();  ///< Clp's word for it.

  /// @return The variable's number, from 0 on.
  int add_variable(double cost, double upper = kUnlimited);
  /// @param guess  A variable that is likely to be above 0 where the row is at its low end, which
  /// saves the search for it.
  void add_row(const Terms& terms, double low, double high,
               std::optional<int> guess = std::nullopt);

  struct Solution {
    double minimum = 0;
    std::vector<double> values;  ///< By variable.
  };
  /// Absent if there is no solution or no finite one. Rows hold within 1e-9 of their scale; numbers
  /// have 12 digits, the same on every processor.
  [[nodiscard]] std::optional<Solution> solve() const;
  [[nodiscard]] std::optional<double> minimum() const {
    const auto solution = solve();
    return solution ? std::optional(solution->minimum) : std::nullopt;
  }

 private:
  [[nodiscard]] std::vector<unsigned char> first_basis() const;

  std::vector<double> costs_, uppers_;  ///< By variable.
  std::vector<double> lows_, highs_;    ///< By row.
  std::vector<std::optional<int>> guesses_;
  std::vector<int> starts_ = {0};  ///< Where each row's terms begin, and where the last one's end.
  std::vector<int> variables_;     ///< Of all terms,
  std::vector<double> coefficients_;
};

}  // namespace pirt
