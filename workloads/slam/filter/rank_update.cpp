// Blocks of 8 x 4 in registers. Compiled twice, for any processor and for AVX2 with FMA; which one
// runs is decided when it is first needed, so that the program starts everywhere. The two differ in
// rounding.
#include "workloads/slam/filter/rank_update.h"

#include <algorithm>
#include <cstring>
#include <vector>

namespace pirt::slam {
namespace {

constexpr Eigen::Index kRows = 8;
constexpr Eigen::Index kColumns = 4;
constexpr std::size_t kLanes = 4;
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));

/// @param w       Column-major, @p padded rows of which those from n on are 0.
/// @param square  Column-major, n x n.
[[gnu::always_inline]] inline void subtract(double* square, Eigen::Index n, const double* w,
                                            Eigen::Index padded, Eigen::Index columns) {
  for (Eigen::Index j = 0; j < n; j += kColumns) {
    for (Eigen::Index i = j - j % kRows; i < n; i += kRows) {
      Lanes sums[kColumns][2] = {};
      for (Eigen::Index k = 0; k < columns; ++k) {
        Lanes low, high;
        std::memcpy(&low, w + k * padded + i, sizeof low);
        std::memcpy(&high, w + k * padded + i + 4, sizeof high);
        for (Eigen::Index c = 0; c < kColumns; ++c) {
          const double factor = w[k * padded + j + c];
          sums[c][0] += low * factor;
          sums[c][1] += high * factor;
        }
      }
      for (Eigen::Index c = 0; c < std::min(kColumns, n - j); ++c) {
        double block[kRows];
        std::memcpy(block, sums[c], sizeof block);
        // What lies above the diagonal comes from its mirror image.
        for (Eigen::Index r = std::max<Eigen::Index>(0, j + c - i); r < std::min(kRows, n - i);
             ++r) {
          const double value = square[(j + c) * n + i + r] - block[r];
          square[(j + c) * n + i + r] = square[(i + r) * n + j + c] = value;
        }
      }
    }
  }
}

void subtract_anywhere(double* square, Eigen::Index n, const double* w, Eigen::Index padded,
                       Eigen::Index columns) {
  subtract(square, n, w, padded, columns);
}

#ifdef __x86_64__
[[gnu::target("avx2,fma")]] void subtract_with_fma(double* square, Eigen::Index n, const double* w,
                                                   Eigen::Index padded, Eigen::Index columns) {
  subtract(square, n, w, padded, columns);
}
bool has_fma() { return __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0; }
#else
constexpr auto subtract_with_fma = subtract_anywhere;
bool has_fma() { return false; }
#endif

}  // namespace

void subtract_square(Eigen::MatrixXd& covariance, const Eigen::MatrixXd& w) {
  const Eigen::Index n = w.rows();
  const Eigen::Index padded = (n + kRows - 1) / kRows * kRows;
  Eigen::MatrixXd wide = Eigen::MatrixXd::Zero(padded, w.cols());
  wide.topRows(n) = w;
  static const auto best = has_fma() ? subtract_with_fma : subtract_anywhere;
  best(covariance.data(), n, wide.data(), padded, w.cols());
}

}  // namespace pirt::slam
