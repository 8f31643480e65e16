// S, the residual and P H^T lie below each other in one tall matrix, so that its Cholesky
// factorization, carried on below the square, is all of the update's divisions. It is kept as
// strips of 8 rows, each column by column, and computed in blocks of 8 x 4 in registers. Compiled
// twice, for any processor and for AVX2 with FMA; which one runs is decided when it is first
// needed, so that the program starts everywhere. The two differ in rounding.
#include "workloads/slam/filter/dense_update.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include "workloads/base/system/processor.h"

namespace pirt::slam {
namespace {

using Eigen::Index;
constexpr Index kRows = 8;
constexpr Index kColumns = 4;
constexpr Index kLanes = 4;
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));

/// Columns of 8 rows.
using Block = std::array<std::array<double, kRows>, kColumns>;

/// Row i of column j: strip i / 8 at [j * 8 + i % 8].
struct Strips {
  Strips(Index row_count, Index column_count)
      : columns(column_count),
        count((row_count + kRows - 1) / kRows),
        values(static_cast<std::size_t>(count * columns * kRows), 0.0) {}

  [[nodiscard]] double* strip(Index i) { return values.data() + i * columns * kRows; }
  [[nodiscard]] const double* strip(Index i) const { return values.data() + i * columns * kRows; }

  /// @param at  A multiple of 8.
  void set(Index at, const Eigen::MatrixXd& rows) {
    for (Index i = 0; i < rows.rows(); i += kRows) {
      const Index height = std::min(kRows, rows.rows() - i);
      double* to = strip((at + i) / kRows);
      for (Index j = 0; j < columns; ++j) {
        std::copy_n(rows.data() + j * rows.rows() + i, height, to + j * kRows);
      }
    }
  }

  Index columns;
  Index count;
  std::vector<double> values;
};

/// The products of 8 rows with 4 rows, of the first @p columns columns.
/// @param factors  Its first is the first of the 4 rows in a strip.
[[gnu::always_inline]] inline void products(const double* rows, const double* factors,
                                            Index columns, Block& sums) {
  Lanes low[kColumns] = {};
  Lanes high[kColumns] = {};
  for (Index k = 0; k < columns; ++k) {
    Lanes upper, lower;
    std::memcpy(&upper, rows + k * kRows, sizeof upper);
    std::memcpy(&lower, rows + k * kRows + kLanes, sizeof lower);
    for (Index c = 0; c < kColumns; ++c) {
      const double factor = factors[k * kRows + c];
      low[c] += upper * factor;
      high[c] += lower * factor;
    }
  }
  for (std::size_t c = 0; c < kColumns; ++c) {
    std::memcpy(sums[c].data(), &low[c], sizeof low[c]);
    std::memcpy(sums[c].data() + kLanes, &high[c], sizeof high[c]);
  }
}

/// Four columns of a strip, once those left of them are known.
struct Panel {
  const double* factors;  ///< The rows of the square that the columns lie on.
  Index first;
  Index width;
  Block diagonal{};  ///< [c][r]: column c of the factor, rows of the panel.
  std::array<double, kColumns> inverse{};
};

[[gnu::always_inline]] inline void reduce(double* strip, const Panel& panel) {
  Block sums;
  products(strip, panel.factors, panel.first, sums);
  for (Index c = 0; c < panel.width; ++c) {
    double* column = strip + (panel.first + c) * kRows;
    for (Index r = 0; r < kRows; ++r)
      column[r] -= sums[static_cast<std::size_t>(c)][static_cast<std::size_t>(r)];
  }
}

/// The panel's own square, which lies in @p strip from row @p at on.
[[gnu::always_inline]] inline bool factor_diagonal(const double* strip, Index at, Panel& panel) {
  for (Index c = 0; c < panel.width; ++c) {
    const auto column = static_cast<std::size_t>(c);
    for (Index r = c; r < panel.width; ++r) {
      double value = strip[(panel.first + c) * kRows + at + r];
      for (std::size_t k = 0; k < column; ++k) {
        value -= panel.diagonal[k][static_cast<std::size_t>(r)] * panel.diagonal[k][column];
      }
      if (r == c) {
        if (!(value > 0)) return false;
        value = std::sqrt(value);
        panel.inverse[column] = 1 / value;
      } else {
        value *= panel.inverse[column];
      }
      panel.diagonal[column][static_cast<std::size_t>(r)] = value;
    }
  }
  return true;
}

/// The panel's columns of a strip times the inverse of its square, transposed.
[[gnu::always_inline]] inline void divide(double* strip, const Panel& panel) {
  for (Index c = 0; c < panel.width; ++c) {
    double* column = strip + (panel.first + c) * kRows;
    for (Index k = 0; k < c; ++k) {
      const double factor =
          panel.diagonal[static_cast<std::size_t>(k)][static_cast<std::size_t>(c)];
      const double* left = strip + (panel.first + k) * kRows;
      for (Index r = 0; r < kRows; ++r) column[r] -= left[r] * factor;
    }
    const double inverse = panel.inverse[static_cast<std::size_t>(c)];
    for (Index r = 0; r < kRows; ++r) column[r] *= inverse;
  }
}

/// [S; B] becomes [L; B L^-T]. Above L's diagonal stands anything.
/// @return False if S is not positive definite.
[[gnu::always_inline]] inline bool factor(Strips& tall) {
  for (Index first = 0; first < tall.columns; first += kColumns) {
    const Index top = first / kRows;
    const Index at = first % kRows;
    Panel panel{tall.strip(top) + at, first, std::min(kColumns, tall.columns - first)};
    reduce(tall.strip(top), panel);
    if (!factor_diagonal(tall.strip(top), at, panel)) return false;
    divide(tall.strip(top), panel);
    for (Index i = top + 1; i < tall.count; ++i) {
      reduce(tall.strip(i), panel);
      divide(tall.strip(i), panel);
    }
  }
  return true;
}

/// square -= w w^T.
/// @param square  Column-major, n x n.
/// @param begin   The strip that w begins with; n rows.
[[gnu::always_inline]] inline void subtract_square(double* square, Index n, const Strips& w,
                                                   Index begin) {
  for (Index j = 0; j < n; j += kColumns) {
    const Index width = std::min(kColumns, n - j);
    const double* factors = w.strip(begin + j / kRows) + j % kRows;
    for (Index i = j - j % kRows; i < n; i += kRows) {
      Block sums;
      products(w.strip(begin + i / kRows), factors, w.columns, sums);
      const Index height = std::min(kRows, n - i);
      for (Index c = 0; c < width; ++c) {
        // What lies above the diagonal comes from its mirror image.
        for (Index r = std::max<Index>(0, j + c - i); r < height; ++r) {
          const double value = square[(j + c) * n + i + r] -
                               sums[static_cast<std::size_t>(c)][static_cast<std::size_t>(r)];
          square[(j + c) * n + i + r] = square[(i + r) * n + j + c] = value;
        }
      }
    }
  }
}

bool factor_anywhere(Strips& tall) { return factor(tall); }
void subtract_anywhere(double* square, Index n, const Strips& w, Index begin) {
  subtract_square(square, n, w, begin);
}

#ifdef __x86_64__
[[gnu::target("avx2,fma")]] bool factor_with_fma(Strips& tall) { return factor(tall); }
[[gnu::target("avx2,fma")]] void subtract_with_fma(double* square, Index n, const Strips& w,
                                                   Index begin) {
  subtract_square(square, n, w, begin);
}
#else
constexpr auto factor_with_fma = factor_anywhere;
constexpr auto subtract_with_fma = subtract_anywhere;
#endif

}  // namespace

std::optional<Eigen::VectorXd> dense_update(Eigen::MatrixXd& covariance,
                                            const Eigen::MatrixXd& innovation,
                                            const Eigen::MatrixXd& gain,
                                            const Eigen::VectorXd& residual) {
  static const bool fma = has_avx2_and_fma();
  const Index n = covariance.rows();
  const Index m = innovation.rows();
  // Each part begins with a strip: rows between are 0, and stay so.
  const Index residual_at = (m + kRows - 1) / kRows;
  const Index gain_at = residual_at + 1;
  Strips tall(gain_at * kRows + n, m);
  tall.set(0, innovation);
  tall.set(residual_at * kRows, residual.transpose());
  tall.set(gain_at * kRows, gain);
  if (!(fma ? factor_with_fma : factor_anywhere)(tall)) return std::nullopt;
  Eigen::VectorXd correction(n);
  const double* whitened = tall.strip(residual_at);
  for (Index i = 0; i < n; i += kRows) {
    const double* strip = tall.strip(gain_at + i / kRows);
    std::array<double, kRows> sums{};
    for (Index k = 0; k < m; ++k) {
      for (std::size_t r = 0; r < kRows; ++r) {
        sums[r] += strip[k * kRows + static_cast<Index>(r)] * whitened[k * kRows];
      }
    }
    std::copy_n(sums.data(), std::min(kRows, n - i), correction.data() + i);
  }
  if (!correction.allFinite()) return std::nullopt;
  (fma ? subtract_with_fma : subtract_anywhere)(covariance.data(), n, tall, gain_at);
  return correction;
}

}  // namespace pirt::slam
